"""What every thermal half of this package says of itself: its inputs and outputs, in one order."""

from __future__ import annotations

import numpy as np

from contact.half.interface import Interface
from contact.half.model import Values, Variable
from thermal_fmu.heat import names_of
from thermal_fmu.spec import Model


def face_variables(interface: Interface, model: Model) -> tuple[Variable, ...]:
    """The variables of a thermal half, but for those that only one kind of half has."""
    n, n_s = len(interface.nodes), len(interface.contact_nodes)
    n_cells = len(interface.quads) + len(interface.triangles)
    surface = (Variable("contact.t_N", (n_s,), "input", "Pa", 0.0,
                        description="normal traction at surface nodes, <= 0"),
               Variable("contact.E_friction", (n_s,), "input", "J", 0.0,
                        description="friction heat of the substep at surface nodes")) if n_s else ()
    return (
        Variable("x", (n, 2), "input", "m", interface.nodes, description="coordinates, held in a substep"),
        *surface,
        Variable("E_M", (n_cells,), "input", "J", 0.0, description="mechanical heat of the substep"),
        Variable("E_S", (n_cells,), "input", "J", 0.0, description="entropy part, given at the substep's start"),
        *(Variable(f"load.{name}", (), "input", "1", 1.0) for name in model.load_names),
        Variable("T", (n,), unit="K", description="nodal temperature at the end of the substep"),
        *(Variable(name, unit="J", description="energy of the substep into the bodies") for name in names_of(model)),
        Variable("iterations", description="linear solves of the substep"),
        Variable("residual", description="heat missing, as a share of the heat that flowed"),
        Variable("max_dT", unit="K", description="largest change of a nodal temperature in the substep"),
        Variable("heat_stored", unit="J", description="enthalpy gained since the start"),
        Variable("contact.touching", description="facing points under pressure"),
    )


def whole(inputs: Values, name: str) -> int:
    """An Integer input; 0 where the caller has none."""
    value = inputs.get(name, 0)
    assert isinstance(value, int | np.integer), f"{name} is an Integer"
    return int(value)

"""The thermal half: 2-D transient heat conduction with contact, behind FMI (physics: Eqs. 1-13, 22)."""

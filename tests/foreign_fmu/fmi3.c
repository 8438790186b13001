/* The half of half.c behind FMI 3.0: the same numbers, as arrays.
   Value references: 1 temperatures (N), 2 positions (N, 2) row by row, 3 pressures (Q); 0 is time.

   With RETURNS_EARLY every step ends in its middle; with ENDS it asks for the end in its third. */
#include <stdbool.h>
#include <stdint.h>

#include "half.c"

static double now;

const char *fmi3GetVersion(void) { return "3.0"; }

Any fmi3InstantiateCoSimulation(const char *name, const char *token, const char *where, bool visible, bool logging,
                                bool events, bool early, const Ref needed[], size_t n, Any environment,
                                void (*say)(Any, int, const char *, const char *), Any update)
{
    if (say) say(environment, 0, "logAll", "arrays: 100 %s of them");  /* plain text, no format */
    return fmi2Instantiate(name, 1, token, where, NULL, visible, logging);
}

void fmi3FreeInstance(Any half) { fmi2FreeInstance(half); }
int fmi3SetDebugLogging(Any half, bool on, size_t n, const char *const names[]) { return 0; }

int fmi3EnterInitializationMode(Any half, bool given, double tolerance, double start, bool ends, double stop)
{
    now = start;
    return 0;
}

int fmi3ExitInitializationMode(Any half) { return 0; }
int fmi3Terminate(Any half) { return 0; }
int fmi3Reset(Any half) { return 0; }

static size_t array(Half *half, Ref ref, double **values)
{
    double *const all[] = {&now, half->T, half->x, half->p};
    const size_t sizes[] = {1, N, 2 * N, Q};
    *values = all[ref];
    return sizes[ref];
}

int fmi3GetFloat64(Any half, const Ref refs[], size_t n, double values[], size_t room)
{
    double *from;
    for (size_t k = 0; k < n; k++) {
        const size_t size = refs[k] > 3 ? room + 1 : array(half, refs[k], &from);
        if (size > room) return 3;  /* too few values, or a reference of none */
        memcpy(values, from, size * sizeof(double));
        values += size;
        room -= size;
    }
    return room ? 3 : 0;
}

int fmi3SetFloat64(Any half, const Ref refs[], size_t n, const double values[], size_t room)
{
    double *to;
    for (size_t k = 0; k < n; k++) {
        const size_t size = refs[k] > 3 ? room + 1 : array(half, refs[k], &to);
        if (size > room) return 3;
        memcpy(to, values, size * sizeof(double));
        values += size;
        room -= size;
    }
    return room ? 3 : 0;
}

int fmi3DoStep(Any half, double t, double h, bool no_set_before, bool *event, bool *ends, bool *early, double *reached)
{
    *event = *ends = *early = false;
    *reached = t;
#ifdef RETURNS_EARLY
    *early = true;
    h /= 2;
#endif
    const int status = fmi2DoStep(half, t, h, 1);
#ifdef ENDS
    *ends = ((Half *)half)->made > 2;
#endif
    if (!status) *reached = now = t + h;
    return status;
}

int fmi3GetFMUState(Any half, Any *state) { return fmi2GetFMUstate(half, state); }
int fmi3SetFMUState(Any half, Any state) { return fmi2SetFMUstate(half, state); }
int fmi3FreeFMUState(Any half, Any *state) { return fmi2FreeFMUstate(half, state); }
int fmi3SerializedFMUStateSize(Any half, Any state, size_t *size) { return fmi2SerializedFMUstateSize(half, state, size); }

int fmi3SerializeFMUState(Any half, Any state, uint8_t bytes[], size_t size)
{
    return fmi2SerializeFMUstate(half, state, bytes, size);
}

int fmi3DeserializeFMUState(Any half, const uint8_t bytes[], size_t size, Any *state)
{
    return fmi2DeSerializeFMUstate(half, bytes, size, state);
}

/* What no run asks of it; a library of FMI 3.0 has them all. */
UNABLE(fmi3ActivateModelPartition) UNABLE(fmi3CompletedIntegratorStep) UNABLE(fmi3EnterConfigurationMode)
UNABLE(fmi3EnterContinuousTimeMode) UNABLE(fmi3EnterEventMode) UNABLE(fmi3EnterStepMode)
UNABLE(fmi3EvaluateDiscreteStates) UNABLE(fmi3ExitConfigurationMode) UNABLE(fmi3GetAdjointDerivative)
UNABLE(fmi3GetBinary) UNABLE(fmi3GetBoolean) UNABLE(fmi3GetClock) UNABLE(fmi3GetContinuousStateDerivatives)
UNABLE(fmi3GetContinuousStates) UNABLE(fmi3GetDirectionalDerivative) UNABLE(fmi3GetEventIndicators)
UNABLE(fmi3GetFloat32) UNABLE(fmi3GetInt16) UNABLE(fmi3GetInt32) UNABLE(fmi3GetInt64) UNABLE(fmi3GetInt8)
UNABLE(fmi3GetIntervalDecimal) UNABLE(fmi3GetIntervalFraction) UNABLE(fmi3GetNominalsOfContinuousStates)
UNABLE(fmi3GetNumberOfContinuousStates) UNABLE(fmi3GetNumberOfEventIndicators)
UNABLE(fmi3GetNumberOfVariableDependencies) UNABLE(fmi3GetOutputDerivatives) UNABLE(fmi3GetShiftDecimal)
UNABLE(fmi3GetShiftFraction) UNABLE(fmi3GetString) UNABLE(fmi3GetUInt16) UNABLE(fmi3GetUInt32) UNABLE(fmi3GetUInt64)
UNABLE(fmi3GetUInt8) UNABLE(fmi3GetVariableDependencies) UNABLE(fmi3InstantiateModelExchange)
UNABLE(fmi3InstantiateScheduledExecution) UNABLE(fmi3SetBinary) UNABLE(fmi3SetBoolean) UNABLE(fmi3SetClock)
UNABLE(fmi3SetContinuousStates) UNABLE(fmi3SetFloat32) UNABLE(fmi3SetInt16) UNABLE(fmi3SetInt32) UNABLE(fmi3SetInt64)
UNABLE(fmi3SetInt8) UNABLE(fmi3SetIntervalDecimal) UNABLE(fmi3SetIntervalFraction) UNABLE(fmi3SetShiftDecimal)
UNABLE(fmi3SetShiftFraction) UNABLE(fmi3SetString) UNABLE(fmi3SetTime) UNABLE(fmi3SetUInt16) UNABLE(fmi3SetUInt32)
UNABLE(fmi3SetUInt64) UNABLE(fmi3SetUInt8) UNABLE(fmi3UpdateDiscreteStates)

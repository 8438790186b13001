/* A thermal half by another tool, in C: every node goes from its start towards T_end,

       dT/dt = (T_end - T) / tau,     T_end = T_hot + slope * pressure of all,

   exact in a step of any size.  It speaks degrees Celsius, millimetres and megapascals, and has names of its own.
   Value references: 0 to N-1 temperatures [degC] (local); 1000 and on positions [mm]; 100000 and on pressures [MPa].
   N, Q and the numbers of the law are defined when it is compiled (make.py). */
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct { double T[N], x[2 * N], p[Q + 1]; } Half;
typedef void *Any;
typedef unsigned int Ref;

static int unable(void) { return 3; }

const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

Any fmi2Instantiate(const char *name, int kind, const char *guid, const char *where, const void *callbacks, int visible,
                    int logging)
{
    Half *half = calloc(1, sizeof(Half));
    for (int i = 0; half && i < N; i++) half->T[i] = T_START;
    return half;
}

void fmi2FreeInstance(Any half) { free(half); }
int fmi2SetDebugLogging(Any half, int on, size_t n, const char *const names[]) { return 0; }
int fmi2SetupExperiment(Any half, int a, double b, double start, int c, double stop) { return 0; }
int fmi2EnterInitializationMode(Any half) { return 0; }
int fmi2ExitInitializationMode(Any half) { return 0; }
int fmi2Terminate(Any half) { return 0; }
int fmi2Reset(Any half) { return 0; }

static double *at(Half *half, Ref ref)
{
    if (ref >= 100000) return half->p + (ref - 100000);
    return ref >= 1000 ? half->x + (ref - 1000) : half->T + ref;
}

int fmi2GetReal(Any half, const Ref refs[], size_t n, double values[])
{
    for (size_t k = 0; k < n; k++) values[k] = *at(half, refs[k]);
    return 0;
}

int fmi2SetReal(Any half, const Ref refs[], size_t n, const double values[])
{
    for (size_t k = 0; k < n; k++) *at(half, refs[k]) = values[k];
    return 0;
}

int fmi2DoStep(Any any, double t, double h, int keep)
{
    Half *half = any;
    double pressure = 0.0;
    for (int q = 0; q < Q; q++) pressure += half->p[q] / Q;
    for (int i = 0; i < N; i++) {
        const double end = T_HOT + SLOPE * pressure;
        half->T[i] = end + (half->T[i] - end) * exp(-h / TAU);
    }
    return 0;
}

int fmi2GetFMUstate(Any half, Any *state)
{
    if (!*state) *state = malloc(sizeof(Half));
    memcpy(*state, half, sizeof(Half));
    return 0;
}

int fmi2SetFMUstate(Any half, Any state) { memcpy(half, state, sizeof(Half)); return 0; }
int fmi2FreeFMUstate(Any half, Any *state) { free(*state); *state = NULL; return 0; }
int fmi2SerializedFMUstateSize(Any half, Any state, size_t *size) { *size = sizeof(Half); return 0; }

int fmi2SerializeFMUstate(Any half, Any state, unsigned char bytes[], size_t size)
{
    memcpy(bytes, state, sizeof(Half));
    return 0;
}

int fmi2DeSerializeFMUstate(Any half, const unsigned char bytes[], size_t size, Any *state)
{
    *state = malloc(sizeof(Half));
    memcpy(*state, bytes, sizeof(Half));
    return 0;
}

/* What no run asks of it. */
#define UNABLE(name) int name(void) { return unable(); }
UNABLE(fmi2GetInteger) UNABLE(fmi2GetBoolean) UNABLE(fmi2GetString) UNABLE(fmi2SetInteger) UNABLE(fmi2SetBoolean)
UNABLE(fmi2SetString) UNABLE(fmi2GetDirectionalDerivative) UNABLE(fmi2SetRealInputDerivatives)
UNABLE(fmi2GetRealOutputDerivatives) UNABLE(fmi2CancelStep) UNABLE(fmi2GetStatus) UNABLE(fmi2GetRealStatus)
UNABLE(fmi2GetIntegerStatus) UNABLE(fmi2GetBooleanStatus) UNABLE(fmi2GetStringStatus)

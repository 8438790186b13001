/* A thermal half by another tool, in C: every node goes from its start towards T_end,

       dT/dt = (T_end - T) / tau,     T_end = T_hot + slope * pressure of all,

   exact in a step of any size.  It speaks degrees Celsius, millimetres and megapascals, and has names of its own.
   Value references: 0 to N-1 temperatures [degC] (local); 1000 and on positions [mm]; 100000 and on pressures [MPa].
   N, Q and the numbers of the law are defined when it is compiled (make.py), and at most one of what is wrong with it:
   DISCARDS (every step), NOT_A_NUMBER, RUNS_AWAY (from its third step), HANGS, CRASHES, EXITS (in its third step),
   HIDDEN (counts its steps beside its state), KEEPS_TIME (takes a second for any step).

   With BODY it is a mechanical half instead: the temperatures are inputs, positions the coordinates of the mesh times
   SCALE, without them where DISPLACEMENTS is defined; nothing presses, nothing is faced. */
#define _GNU_SOURCE
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#ifdef BODY
static const double MESH[2 * N] = {
#include "mesh.h"
};
#endif
#ifndef SCALE
#define SCALE 1.0
#endif
typedef struct { double T[N], x[2 * N], p[Q + 1]; int made; } Half;
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
#if defined(BODY) && !defined(DISPLACEMENTS)
    for (int i = 0; half && i < 2 * N; i++) half->x[i] = SCALE * MESH[i];
#endif
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
    half->made++;
#ifdef DISCARDS
    return 2;
#endif
#ifdef HANGS
    while (half->made > 2) pause();
#endif
#ifdef CRASHES
    if (half->made > 2) raise(SIGSEGV);
#endif
#ifdef EXITS
    if (half->made > 2) exit(0);
#endif
#ifdef KEEPS_TIME
    h = 1.0;
#endif
#ifndef BODY
    for (int q = 0; q < Q; q++) pressure += half->p[q] / Q;
    for (int i = 0; i < N; i++) {
        const double end = T_HOT + SLOPE * pressure;
        half->T[i] = end + (half->T[i] - end) * exp(-h / TAU);
    }
#ifdef NOT_A_NUMBER
    if (half->made > 2) half->T[1] = NAN;
#endif
#ifdef RUNS_AWAY
    if (half->made > 2) half->T[1] = 1e9;
#endif
#ifdef HIDDEN
    static int steps;
    half->T[1] += 1e-3 * ++steps;
#endif
#endif
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

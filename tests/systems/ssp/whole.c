/* An FMU of FMI 2.0 with an input and an output of every type, each type with references of its own. Nothing in it knows
   this project. y = 2·u + n + (on ? 100 : 0), m = n + 1, is_on = not on, chosen = choice. */
#include <stddef.h>
#include <stdlib.h>
#define EXPORT __attribute__((visibility("default")))

enum { U, Y, N = 0, M, CHOICE, CHOSEN, ON = 0, IS_ON };

struct fmu {
    double u;
    int n, choice, on;
};

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources, const void *callbacks,
                             int visible, int logging) {
    struct fmu *s = calloc(1, sizeof *s);
    s->choice = 1;
    return s;
}
EXPORT void fmi2FreeInstance(struct fmu *s) { free(s); }
EXPORT int fmi2SetDebugLogging(struct fmu *s, int on, size_t n, const char *const *c) { return 0; }
EXPORT int fmi2SetupExperiment(struct fmu *s, int tolerates, double tolerance, double start, int stops, double stop) { return 0; }
EXPORT int fmi2EnterInitializationMode(struct fmu *s) { return 0; }
EXPORT int fmi2ExitInitializationMode(struct fmu *s) { return 0; }
EXPORT int fmi2Terminate(struct fmu *s) { return 0; }
EXPORT int fmi2Reset(struct fmu *s) {
    *s = (struct fmu){.choice = 1};
    return 0;
}
EXPORT int fmi2DoStep(struct fmu *s, double time, double step, int fixed) { return 0; }
EXPORT int fmi2CancelStep(struct fmu *s) { return 3; }

EXPORT int fmi2SetReal(struct fmu *s, const unsigned *r, size_t n, const double *values) {
    for (size_t k = 0; k < n; k++)
        if (r[k] == U) s->u = values[k];
        else return 3;
    return 0;
}
EXPORT int fmi2GetReal(struct fmu *s, const unsigned *r, size_t n, double *values) {
    for (size_t k = 0; k < n; k++) values[k] = r[k] == U ? s->u : 2 * s->u + s->n + (s->on ? 100 : 0);
    return 0;
}
EXPORT int fmi2SetInteger(struct fmu *s, const unsigned *r, size_t n, const int *values) {
    for (size_t k = 0; k < n; k++)
        if (r[k] == N) s->n = values[k];
        else if (r[k] == CHOICE && values[k] >= 1 && values[k] <= 3) s->choice = values[k];
        else return 3;
    return 0;
}
EXPORT int fmi2GetInteger(struct fmu *s, const unsigned *r, size_t n, int *values) {
    for (size_t k = 0; k < n; k++) values[k] = r[k] == N ? s->n : r[k] == M ? s->n + 1 : s->choice;
    return 0;
}
EXPORT int fmi2SetBoolean(struct fmu *s, const unsigned *r, size_t n, const int *values) {
    for (size_t k = 0; k < n; k++)
        if (r[k] == ON && (values[k] == 0 || values[k] == 1)) s->on = values[k];
        else return 3;
    return 0;
}
EXPORT int fmi2GetBoolean(struct fmu *s, const unsigned *r, size_t n, int *values) {
    for (size_t k = 0; k < n; k++) values[k] = r[k] == ON ? s->on : !s->on;
    return 0;
}
EXPORT int fmi2SetString(struct fmu *s, const unsigned *r, size_t n, const char *const *values) { return 3; }
EXPORT int fmi2GetString(struct fmu *s, const unsigned *r, size_t n, const char **values) { return 3; }
EXPORT int fmi2GetFMUstate(struct fmu *s, void **state) { return 3; }
EXPORT int fmi2SetFMUstate(struct fmu *s, void *state) { return 3; }
EXPORT int fmi2FreeFMUstate(struct fmu *s, void **state) { return 3; }
EXPORT int fmi2SerializedFMUstateSize(struct fmu *s, void *state, size_t *n) { return 3; }
EXPORT int fmi2SerializeFMUstate(struct fmu *s, void *state, char *bytes, size_t n) { return 3; }
EXPORT int fmi2DeSerializeFMUstate(struct fmu *s, const char *bytes, size_t n, void **state) { return 3; }
EXPORT int fmi2GetDirectionalDerivative(struct fmu *s, const unsigned *u, size_t nu, const unsigned *k, size_t nk,
                                        const double *d, double *out) { return 3; }
EXPORT int fmi2SetRealInputDerivatives(struct fmu *s, const unsigned *r, size_t n, const int *o, const double *v) { return 3; }
EXPORT int fmi2GetRealOutputDerivatives(struct fmu *s, const unsigned *r, size_t n, const int *o, double *v) { return 3; }
EXPORT int fmi2GetStatus(struct fmu *s, int kind, int *v) { return 3; }
EXPORT int fmi2GetRealStatus(struct fmu *s, int kind, double *v) { return 3; }
EXPORT int fmi2GetIntegerStatus(struct fmu *s, int kind, int *v) { return 3; }
EXPORT int fmi2GetBooleanStatus(struct fmu *s, int kind, int *v) { return 3; }
EXPORT int fmi2GetStringStatus(struct fmu *s, int kind, const char **v) { return 3; }

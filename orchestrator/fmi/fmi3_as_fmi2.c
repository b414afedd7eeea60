/* The functions of FMI 2.0 on top of an FMU of FMI 3.0, so that one master runs both.
   `fmi3.py` describes the table to Python and fills it. Neither events nor early returns are asked for: the FMU steps
   as one of FMI 2.0 does. */
#include <limits.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { OK, WARNING, DISCARD, ERROR };
enum { FLOAT64, FLOAT32, INT8, UINT8, INT16, UINT16, INT32, UINT32, INT64, UINT64, BOOLEAN, KINDS };

typedef void (*fmi3_log)(void *, int, const char *, const char *);
typedef int (*values)(void *, const unsigned *, size_t, void *, size_t);

struct table {
    void *(*instantiate)(const char *, const char *, const char *, bool, bool, bool, bool, const unsigned *, size_t, void *,
                         fmi3_log, void *);
    void (*free_instance)(void *);
    int (*set_debug_logging)(void *, bool, size_t, const char *const *);
    int (*enter_initialization)(void *, bool, double, double, bool, double);
    int (*exit_initialization)(void *);
    int (*terminate)(void *);
    int (*reset)(void *);
    int (*do_step)(void *, double, double, bool, bool *, bool *, bool *, double *);
    int (*get_state)(void *, void **);
    int (*set_state)(void *, void *);
    int (*free_state)(void *, void **);
    int (*state_size)(void *, void *, size_t *);
    int (*serialize)(void *, void *, unsigned char *, size_t);
    int (*deserialize)(void *, const unsigned char *, size_t, void **);
    int (*derivative)(void *, const unsigned *, size_t, const unsigned *, size_t, const double *, size_t, double *, size_t);
    values get[KINDS], set[KINDS];
    const char *resources;
    const unsigned *references; /* of all variables, sorted */
    const unsigned char *kinds; /* of the same */
    size_t n;
    int64_t narrow; /* whether there is a Float32 */
};

struct callbacks {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate, *free, *finished, *environment;
};

struct instance {
    struct table fmu;
    const struct callbacks *callbacks;
    void *inner;
    char *name;
    double start, stop, tolerance;
    int stops, tolerates;
};

static const struct table *next; /* for the next instance */

EXPORT void fmi3_prepare(const struct table *table) { next = table; }

/* The logger takes a printf format. That '#' has a meaning as well is left alone: the master's logger gives it none. */
static void receive(void *environment, int status, const char *category, const char *text) {
    struct instance *s = environment;
    char format[2048];
    size_t k = 0;
    if (!s || !s->callbacks->logger) return;
    for (text = text ? text : ""; *text && k < sizeof format - 2; ++text) {
        if (*text == '%') format[k++] = *text;
        format[k++] = *text;
    }
    format[k] = 0;
    s->callbacks->logger(s->callbacks->environment, s->name, status, category ? category : "", format);
}

static int say(struct instance *s, int status, const char *format, ...) {
    char text[256];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    receive(s, status, "", text);
    return status;
}

static int kind_of(const struct instance *s, unsigned reference) {
    size_t low = 0, high = s->fmu.n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (s->fmu.references[middle] < reference)
            low = middle + 1;
        else
            high = middle;
    }
    return low < s->fmu.n && s->fmu.references[low] == reference ? s->fmu.kinds[low] : KINDS;
}

#define WORST(worst, call) \
    do { \
        const int status_ = (call); \
        if (status_ > worst) worst = status_; \
    } while (0)

/* -- values ------------------------------------------------------------------------------------ */

union any {
    float f32;
    int8_t i8;
    uint8_t u8;
    int16_t i16;
    uint16_t u16;
    int32_t i32;
    uint32_t u32;
    int64_t i64;
    uint64_t u64;
    bool truth;
};

EXPORT int fmi2GetReal(struct instance *s, const unsigned *r, size_t n, double *x) {
    if (!s->fmu.narrow) return s->fmu.get[FLOAT64](s->inner, r, n, x, n);
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        float narrow;
        if (kind_of(s, r[k]) != FLOAT32) {
            WORST(worst, s->fmu.get[FLOAT64](s->inner, r + k, 1, x + k, 1));
        } else {
            WORST(worst, s->fmu.get[FLOAT32](s->inner, r + k, 1, &narrow, 1));
            x[k] = narrow;
        }
    }
    return worst;
}

EXPORT int fmi2SetReal(struct instance *s, const unsigned *r, size_t n, double *x) {
    if (!s->fmu.narrow) return s->fmu.set[FLOAT64](s->inner, r, n, x, n);
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        float narrow = (float)x[k];
        if (kind_of(s, r[k]) != FLOAT32)
            WORST(worst, s->fmu.set[FLOAT64](s->inner, r + k, 1, x + k, 1));
        else
            WORST(worst, s->fmu.set[FLOAT32](s->inner, r + k, 1, &narrow, 1));
    }
    return worst;
}

EXPORT int fmi2GetInteger(struct instance *s, const unsigned *r, size_t n, int *x) {
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        const int kind = kind_of(s, r[k]);
        union any v;
        int64_t whole = 0;
        if (kind < INT8 || kind > UINT64) return say(s, ERROR, "value reference %u is of no integer type", r[k]);
        WORST(worst, s->fmu.get[kind](s->inner, r + k, 1, &v, 1));
        if (worst > WARNING) return worst;
        switch (kind) {
            case INT8: whole = v.i8; break;
            case UINT8: whole = v.u8; break;
            case INT16: whole = v.i16; break;
            case UINT16: whole = v.u16; break;
            case INT32: whole = v.i32; break;
            case UINT32: whole = v.u32; break;
            case INT64: whole = v.i64; break;
            default: whole = v.u64 > INT_MAX ? INT64_MAX : (int64_t)v.u64;
        }
        if (whole < INT_MIN || whole > INT_MAX) return say(s, DISCARD, "value reference %u: its value takes more than 32 bits", r[k]);
        x[k] = (int)whole;
    }
    return worst;
}

EXPORT int fmi2SetInteger(struct instance *s, const unsigned *r, size_t n, const int *x) {
    static const int64_t LOW[] = {INT8_MIN, 0, INT16_MIN, 0, INT32_MIN, 0, INT64_MIN, 0};
    static const int64_t HIGH[] = {INT8_MAX, UINT8_MAX, INT16_MAX, UINT16_MAX, INT32_MAX, UINT32_MAX, INT64_MAX, INT64_MAX};
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        const int kind = kind_of(s, r[k]);
        union any v;
        if (kind < INT8 || kind > UINT64) return say(s, ERROR, "value reference %u is of no integer type", r[k]);
        if (x[k] < LOW[kind - INT8] || x[k] > HIGH[kind - INT8])
            return say(s, DISCARD, "value reference %u cannot be %d: its type does not reach so far", r[k], x[k]);
        switch (kind) {
            case INT8: v.i8 = (int8_t)x[k]; break;
            case UINT8: v.u8 = (uint8_t)x[k]; break;
            case INT16: v.i16 = (int16_t)x[k]; break;
            case UINT16: v.u16 = (uint16_t)x[k]; break;
            case INT32: v.i32 = x[k]; break;
            case UINT32: v.u32 = (uint32_t)x[k]; break;
            case INT64: v.i64 = x[k]; break;
            default: v.u64 = (uint64_t)x[k];
        }
        WORST(worst, s->fmu.set[kind](s->inner, r + k, 1, &v, 1));
    }
    return worst;
}

EXPORT int fmi2GetBoolean(struct instance *s, const unsigned *r, size_t n, int *x) {
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        bool truth = false;
        WORST(worst, s->fmu.get[BOOLEAN](s->inner, r + k, 1, &truth, 1));
        x[k] = truth;
    }
    return worst;
}

EXPORT int fmi2SetBoolean(struct instance *s, const unsigned *r, size_t n, const int *x) {
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        bool truth = x[k] != 0;
        WORST(worst, s->fmu.set[BOOLEAN](s->inner, r + k, 1, &truth, 1));
    }
    return worst;
}

/* -- life cycle -------------------------------------------------------------------------------- */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT struct instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                                        const struct callbacks *callbacks, int visible, int logging) {
    struct instance *s = next ? calloc(1, sizeof *s) : NULL;
    (void)type, (void)resources;
    if (!s) return NULL;
    s->fmu = *next, s->callbacks = callbacks;
    s->name = calloc(1, strlen(name) + 1);
    if (s->name) strcpy(s->name, name);
    s->inner = s->name ? s->fmu.instantiate(name, token, s->fmu.resources, visible != 0, logging != 0, false, false, NULL, 0,
                                            s, receive, NULL)
                       : NULL;
    if (s->inner) return s;
    free(s->name);
    free(s);
    return NULL;
}

EXPORT void fmi2FreeInstance(struct instance *s) {
    if (!s) return;
    s->fmu.free_instance(s->inner);
    free(s->name);
    free(s);
}

EXPORT int fmi2SetDebugLogging(struct instance *s, int on, size_t n, const char *const *categories) {
    return s->fmu.set_debug_logging(s->inner, on != 0, n, categories);
}

EXPORT int fmi2SetupExperiment(struct instance *s, int tolerates, double tolerance, double start, int stops, double stop) {
    s->tolerates = tolerates, s->tolerance = tolerance, s->start = start, s->stops = stops, s->stop = stop;
    return OK;
}

EXPORT int fmi2EnterInitializationMode(struct instance *s) {
    return s->fmu.enter_initialization(s->inner, s->tolerates != 0, s->tolerance, s->start, s->stops != 0, s->stop);
}

EXPORT int fmi2ExitInitializationMode(struct instance *s) { return s->fmu.exit_initialization(s->inner); }

EXPORT int fmi2Terminate(struct instance *s) { return s->fmu.terminate(s->inner); }

EXPORT int fmi2Reset(struct instance *s) { return s->fmu.reset(s->inner); }

EXPORT int fmi2DoStep(struct instance *s, double time, double step, int no_return) {
    bool event = false, stop = false, early = false;
    double reached = time + step;
    const int status = s->fmu.do_step(s->inner, time, step, no_return != 0, &event, &stop, &early, &reached);
    if (status > WARNING) return status;
    if (stop) return say(s, DISCARD, "the FMU asks to end the simulation at t = %g s", reached);
    if (early) return say(s, DISCARD, "the FMU returned early from its step, at t = %g s, which it was not allowed to", reached);
    return status;
}

/* -- state and derivatives --------------------------------------------------------------------- */

EXPORT int fmi2GetFMUstate(struct instance *s, void **state) { return s->fmu.get_state(s->inner, state); }

EXPORT int fmi2SetFMUstate(struct instance *s, void *state) { return s->fmu.set_state(s->inner, state); }

EXPORT int fmi2FreeFMUstate(struct instance *s, void **state) { return s->fmu.free_state(s->inner, state); }

EXPORT int fmi2SerializedFMUstateSize(struct instance *s, void *state, size_t *size) {
    return s->fmu.state_size(s->inner, state, size);
}

EXPORT int fmi2SerializeFMUstate(struct instance *s, void *state, unsigned char *bytes, size_t size) {
    return s->fmu.serialize(s->inner, state, bytes, size);
}

EXPORT int fmi2DeSerializeFMUstate(struct instance *s, const unsigned char *bytes, size_t size, void **state) {
    return s->fmu.deserialize(s->inner, bytes, size, state);
}

EXPORT int fmi2GetDirectionalDerivative(struct instance *s, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                                        size_t n_known, const double *seed, double *sensitivity) {
    return s->fmu.derivative(s->inner, unknown, n_unknown, known, n_known, seed, n_known, sensitivity, n_unknown);
}

/* -- what FMI 3.0 has no counterpart of -------------------------------------------------------- */

#define NOT_THERE(name, ...) \
    EXPORT int name(struct instance *s, __VA_ARGS__) { return say(s, ERROR, #name " has no counterpart in FMI 3.0"); }

NOT_THERE(fmi2GetString, const unsigned *r, size_t n, const char **x)
NOT_THERE(fmi2SetString, const unsigned *r, size_t n, const char *const *x)
NOT_THERE(fmi2SetRealInputDerivatives, const unsigned *r, size_t n, const int *order, const double *x)
NOT_THERE(fmi2GetRealOutputDerivatives, const unsigned *r, size_t n, const int *order, double *x)
NOT_THERE(fmi2GetStatus, int kind, int *x)
NOT_THERE(fmi2GetRealStatus, int kind, double *x)
NOT_THERE(fmi2GetIntegerStatus, int kind, int *x)
NOT_THERE(fmi2GetBooleanStatus, int kind, int *x)
NOT_THERE(fmi2GetStringStatus, int kind, const char **x)

EXPORT int fmi2CancelStep(struct instance *s) { return say(s, ERROR, "fmi2CancelStep has no counterpart in FMI 3.0"); }

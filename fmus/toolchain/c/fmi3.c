/* FMI 3.0 for co-simulation on `instance.c`. */
#include <stdbool.h>

typedef void (*fmi3_logger)(void *, int, const char *, const char *);

#define TIME ((unsigned)NV) /* value reference of the independent variable */

static void deliver(struct instance *s, int status, const char *text) {
    ((fmi3_logger)s->logger)(s->environment, status, CATEGORY[status], text);
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT int fmi3SetDebugLogging(struct instance *s, bool on, size_t n, const char *const categories[]) {
    NEEDS(s);
    return set_logging(s, on, n, categories);
}

EXPORT struct instance *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                                    bool logging, bool event_mode, bool early_return,
                                                    const unsigned *intermediate, size_t n_intermediate, void *environment,
                                                    fmi3_logger logger, void *update) {
    (void)visible, (void)early_return, (void)intermediate, (void)n_intermediate, (void)update;
    struct instance *s = name && *name ? create(name) : NULL;
    if (!s) return NULL;
    s->logger = (void *)logger, s->environment = environment;
    s->quiet = !logging;
    if (event_mode)
        say(s, ERROR, "this FMU has no event mode; its modelDescription.xml says so");
    else if (!prepare(s, resources) && (!token || strcmp(token, GUID)))
        say(s, ERROR, "the instantiation token %.100s is not this FMU's, which is %s; read its modelDescription.xml again",
            token ? token : "(none)", GUID);
    if (!s->failed) return s;
    destroy(s);
    return NULL;
}

EXPORT struct instance *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible,
                                                     bool logging, void *environment, fmi3_logger logger) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (logger) logger(environment, ERROR, CATEGORY[ERROR], "this FMU is for co-simulation only");
    return NULL;
}

EXPORT struct instance *fmi3InstantiateScheduledExecution(const char *name, const char *token, const char *resources,
                                                          bool visible, bool logging, void *environment, fmi3_logger logger,
                                                          void *update, void *lock, void *unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)update, (void)lock, (void)unlock;
    if (logger) logger(environment, ERROR, CATEGORY[ERROR], "this FMU is for co-simulation only");
    return NULL;
}

EXPORT void fmi3FreeInstance(struct instance *s) { destroy(s); }

EXPORT int fmi3EnterInitializationMode(struct instance *s, bool tolerance_defined, double tolerance, double start,
                                       bool stop_defined, double stop) {
    NEEDS(s);
    (void)tolerance_defined, (void)tolerance;
    const int status = set_experiment(s, "fmi3EnterInitializationMode", start, stop_defined, stop);
    if (!status) s->phase = INITIALISING;
    return status;
}

EXPORT int fmi3ExitInitializationMode(struct instance *s) {
    NEEDS(s);
    return end_initialisation(s, "fmi3ExitInitializationMode");
}

EXPORT int fmi3Terminate(struct instance *s) {
    NEEDS(s);
    return terminate(s, "fmi3Terminate");
}

EXPORT int fmi3Reset(struct instance *s) {
    NEEDS(s);
    return reset(s);
}

EXPORT int fmi3DoStep(struct instance *s, double time, double step_size, bool no_return, bool *event_needed,
                      bool *terminate, bool *early_return, double *last_time) {
    NEEDS(s);
    (void)no_return;
    if (!event_needed || !terminate || !early_return || !last_time)
        return say(s, ERROR, "fmi3DoStep needs a place for each of its four answers");
    *event_needed = *terminate = *early_return = false;
    *last_time = s->time;
    if (s->phase != STEPPING || s->failed) return allowed(s, "fmi3DoStep", STEPPING);
    const int status = do_step(s, time, step_size);
    *last_time = s->time;
    return status;
}

/* -- values ------------------------------------------------------------------------------------ */

static int sizes_differ(struct instance *s, size_t references, size_t values) {
    if (references == values) return OK;
    return say(s, ERROR, "%zu value references with %zu values; all variables are scalars", references, values);
}

EXPORT int fmi3GetFloat64(struct instance *s, const unsigned *references, size_t n, double *values, size_t n_values) {
    NEEDS(s);
    int status = sizes_differ(s, n, n_values);
    for (size_t i = 0; i < n && !status; ++i)
        if (references[i] == TIME)
            values[i] = s->time;
        else
            status = get_values(s, references + i, 1, values + i);
    return status;
}

EXPORT int fmi3SetFloat64(struct instance *s, const unsigned *references, size_t n, const double *values, size_t n_values) {
    NEEDS(s);
    const int status = sizes_differ(s, n, n_values);
    return status ? status : set_values(s, references, n, values);
}

EXPORT int fmi3GetInt32(struct instance *s, const unsigned *references, size_t n, int32_t *values, size_t n_values) {
    NEEDS(s);
    int status = sizes_differ(s, n, n_values);
    double value = 0;
    for (size_t i = 0; i < n && !status; ++i) {
        status = get_discrete(s, references[i], INTEGER, &value);
        values[i] = (int32_t)value;
    }
    return status;
}

EXPORT int fmi3GetBoolean(struct instance *s, const unsigned *references, size_t n, bool *values, size_t n_values) {
    NEEDS(s);
    int status = sizes_differ(s, n, n_values);
    double value = 0;
    for (size_t i = 0; i < n && !status; ++i) {
        status = get_discrete(s, references[i], BOOLEAN, &value);
        values[i] = value != 0;
    }
    return status;
}

EXPORT int fmi3SetInt32(struct instance *s, const unsigned *references, size_t n, const int32_t *values, size_t n_values) {
    NEEDS(s);
    int worst = sizes_differ(s, n, n_values);
    if (!worst && s->phase == TERMINATED) return after_termination(s);
    for (size_t i = 0; i < n && worst < ERROR; ++i) {
        const int status = set_value(s, references[i], values[i], INTEGER);
        worst = status > worst ? status : worst;
    }
    return worst;
}

EXPORT int fmi3SetBoolean(struct instance *s, const unsigned *references, size_t n, const bool *values, size_t n_values) {
    NEEDS(s);
    int worst = sizes_differ(s, n, n_values);
    if (!worst && s->phase == TERMINATED) return after_termination(s);
    for (size_t i = 0; i < n && worst < ERROR; ++i) {
        const int status = set_value(s, references[i], values[i], BOOLEAN);
        worst = status > worst ? status : worst;
    }
    return worst;
}

/* This FMU has variables of three types; of the others there is nothing to get or set. */
#define NO_VARIABLES(type, value)                                                                                       \
    EXPORT int fmi3Get##type(struct instance *s, const unsigned *r, size_t n, value *v, size_t m) {                     \
        NEEDS(s);                                                                                                       \
        (void)r, (void)v, (void)m;                                                                                      \
        return n ? say(s, ERROR, "this FMU has no " #type " variables") : OK;                                           \
    }                                                                                                                   \
    EXPORT int fmi3Set##type(struct instance *s, const unsigned *r, size_t n, const value *v, size_t m) {               \
        NEEDS(s);                                                                                                       \
        (void)r, (void)v, (void)m;                                                                                      \
        return n ? say(s, ERROR, "this FMU has no " #type " variables") : OK;                                           \
    }
NO_VARIABLES(Float32, float)
NO_VARIABLES(Int8, int8_t)
NO_VARIABLES(UInt8, uint8_t)
NO_VARIABLES(Int16, int16_t)
NO_VARIABLES(UInt16, uint16_t)
NO_VARIABLES(UInt32, uint32_t)
NO_VARIABLES(Int64, int64_t)
NO_VARIABLES(UInt64, uint64_t)
typedef const char *text;
NO_VARIABLES(String, text)

EXPORT int fmi3GetBinary(struct instance *s, const unsigned *r, size_t n, size_t *sizes, const uint8_t **v, size_t m) {
    NEEDS(s);
    (void)r, (void)sizes, (void)v, (void)m;
    return n ? say(s, ERROR, "this FMU has no Binary variables") : OK;
}

EXPORT int fmi3SetBinary(struct instance *s, const unsigned *r, size_t n, const size_t *sizes, const uint8_t *const *v,
                         size_t m) {
    NEEDS(s);
    (void)r, (void)sizes, (void)v, (void)m;
    return n ? say(s, ERROR, "this FMU has no Binary variables") : OK;
}

EXPORT int fmi3GetClock(struct instance *s, const unsigned *r, size_t n, bool *v) {
    NEEDS(s);
    (void)r, (void)v;
    return n ? say(s, ERROR, "this FMU has no clocks") : OK;
}

EXPORT int fmi3SetClock(struct instance *s, const unsigned *r, size_t n, const bool *v) {
    NEEDS(s);
    (void)r, (void)v;
    return n ? say(s, ERROR, "this FMU has no clocks") : OK;
}

/* -- state ------------------------------------------------------------------------------------- */

EXPORT int fmi3GetFMUState(struct instance *s, struct snapshot **copy) {
    NEEDS(s);
    return save(s, copy, "fmi3GetFMUState");
}

EXPORT int fmi3SetFMUState(struct instance *s, const struct snapshot *copy) {
    NEEDS(s);
    return restore_saved(s, copy, "fmi3SetFMUState");
}

EXPORT int fmi3FreeFMUState(struct instance *s, struct snapshot **copy) {
    NEEDS(s);
    return release(copy);
}

EXPORT int fmi3SerializedFMUStateSize(struct instance *s, const struct snapshot *copy, size_t *size) {
    NEEDS(s);
    return serialised_size(s, copy, size, "fmi3SerializedFMUStateSize");
}

EXPORT int fmi3SerializeFMUState(struct instance *s, const struct snapshot *copy, uint8_t *bytes, size_t size) {
    NEEDS(s);
    return serialise(s, copy, bytes, size);
}

EXPORT int fmi3DeserializeFMUState(struct instance *s, const uint8_t *bytes, size_t size, struct snapshot **copy) {
    NEEDS(s);
    return deserialise(s, bytes, size, copy);
}

/* -- derivatives ------------------------------------------------------------------------------- */

EXPORT int fmi3GetDirectionalDerivative(struct instance *s, const unsigned *unknowns, size_t n_unknowns,
                                        const unsigned *knowns, size_t n_knowns, const double *seed, size_t n_seed,
                                        double *sensitivity, size_t n_sensitivity) {
    NEEDS(s);
    const int status = sizes_differ(s, n_knowns, n_seed) || sizes_differ(s, n_unknowns, n_sensitivity);
    return status ? ERROR
                  : directional_derivative(s, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

EXPORT int fmi3GetAdjointDerivative(struct instance *s, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                                    size_t n_knowns, const double *seed, size_t n_seed, double *sensitivity,
                                    size_t n_sensitivity) {
    NEEDS(s);
    int status = sizes_differ(s, n_unknowns, n_seed) || sizes_differ(s, n_knowns, n_sensitivity);
    if (status) return ERROR;
    status = check_derivative_call(s, unknowns, n_unknowns, knowns, n_knowns);
    if (status > WARNING) return status;
    return propagate(s, evaluate_adjoint, unknowns, n_unknowns, seed, knowns, n_knowns, sensitivity);
}

/* -- what co-simulation without events, clocks and arrays has no use for --------------------------- */

#define NOT_HERE(name, ...)                                                                                             \
    EXPORT int name(struct instance *s, ##__VA_ARGS__) {                                                                \
        NEEDS(s);                                                                                                       \
        return say(s, ERROR, #name " is not for this FMU: see the capabilities in its modelDescription.xml");           \
    }
NOT_HERE(fmi3EnterEventMode)
NOT_HERE(fmi3EnterStepMode)
NOT_HERE(fmi3EnterConfigurationMode)
NOT_HERE(fmi3ExitConfigurationMode)
NOT_HERE(fmi3EnterContinuousTimeMode)
NOT_HERE(fmi3EvaluateDiscreteStates)
NOT_HERE(fmi3UpdateDiscreteStates, bool *a, bool *b, bool *c, bool *d, bool *e, double *f)
NOT_HERE(fmi3GetNumberOfVariableDependencies, unsigned r, size_t *n)
NOT_HERE(fmi3GetVariableDependencies, unsigned r, size_t *i, unsigned *v, size_t *j, int *k, size_t n)
NOT_HERE(fmi3GetIntervalDecimal, const unsigned *r, size_t n, double *v, int *q)
NOT_HERE(fmi3GetIntervalFraction, const unsigned *r, size_t n, uint64_t *c, uint64_t *v, int *q)
NOT_HERE(fmi3GetShiftDecimal, const unsigned *r, size_t n, double *v)
NOT_HERE(fmi3GetShiftFraction, const unsigned *r, size_t n, uint64_t *c, uint64_t *v)
NOT_HERE(fmi3SetIntervalDecimal, const unsigned *r, size_t n, const double *v)
NOT_HERE(fmi3SetIntervalFraction, const unsigned *r, size_t n, const uint64_t *c, const uint64_t *v)
NOT_HERE(fmi3SetShiftDecimal, const unsigned *r, size_t n, const double *v)
NOT_HERE(fmi3SetShiftFraction, const unsigned *r, size_t n, const uint64_t *c, const uint64_t *v)
NOT_HERE(fmi3GetOutputDerivatives, const unsigned *r, size_t n, const int32_t *o, double *v, size_t m)
NOT_HERE(fmi3ActivateModelPartition, unsigned r, double t)
NOT_HERE(fmi3CompletedIntegratorStep, bool a, bool *b, bool *c)
NOT_HERE(fmi3SetTime, double t)
NOT_HERE(fmi3SetContinuousStates, const double *x, size_t n)
NOT_HERE(fmi3GetContinuousStateDerivatives, double *x, size_t n)
NOT_HERE(fmi3GetEventIndicators, double *x, size_t n)
NOT_HERE(fmi3GetContinuousStates, double *x, size_t n)
NOT_HERE(fmi3GetNominalsOfContinuousStates, double *x, size_t n)
NOT_HERE(fmi3GetNumberOfEventIndicators, size_t *n)
NOT_HERE(fmi3GetNumberOfContinuousStates, size_t *n)

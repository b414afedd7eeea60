/* FMI 2.0 for co-simulation on `instance.c`. */
typedef void (*fmi2_logger)(void *, const char *, int, const char *, const char *, ...);
struct callbacks {
    fmi2_logger logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*step_finished)(void *, int);
    void *environment;
};

/* The logger takes a printf format, in which FMI also gives '#' a meaning: both are doubled. */
static void deliver(struct instance *s, int status, const char *text) {
    char format[2 * TEXT];
    size_t k = 0;
    for (; *text; ++text) {
        format[k++] = *text;
        if (*text == '%' || *text == '#') format[k++] = *text;
    }
    format[k] = 0;
    ((fmi2_logger)s->logger)(s->environment, s->name, status, CATEGORY[status], format);
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT int fmi2SetDebugLogging(struct instance *s, int on, size_t n, const char *const categories[]) {
    NEEDS(s);
    return set_logging(s, on, n, categories);
}

EXPORT struct instance *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                                        const struct callbacks *functions, int visible, int logging) {
    (void)visible;
    struct instance *s = name && *name ? create(name) : NULL;
    if (!s) return NULL;
    if (functions) s->logger = (void *)functions->logger, s->environment = functions->environment;
    s->quiet = !logging;
    if (type != 1)
        say(s, ERROR, "this FMU is for co-simulation only");
    else if (!prepare(s, resources) && (!guid || strcmp(guid, GUID)))
        say(s, ERROR, "the guid %.100s is not this FMU's, which is %s; read its modelDescription.xml again",
            guid ? guid : "(none)", GUID);
    if (!s->failed) return s;
    destroy(s);
    return NULL;
}

EXPORT void fmi2FreeInstance(struct instance *s) { destroy(s); }

EXPORT int fmi2SetupExperiment(struct instance *s, int tolerance_defined, double tolerance, double start, int stop_defined,
                               double stop) {
    NEEDS(s);
    (void)tolerance_defined, (void)tolerance;
    return set_experiment(s, "fmi2SetupExperiment", start, stop_defined, stop);
}

EXPORT int fmi2EnterInitializationMode(struct instance *s) {
    NEEDS(s);
    const int status = allowed(s, "fmi2EnterInitializationMode", INSTANTIATED);
    if (!status) s->phase = INITIALISING;
    return status;
}

EXPORT int fmi2ExitInitializationMode(struct instance *s) {
    NEEDS(s);
    return end_initialisation(s, "fmi2ExitInitializationMode");
}

EXPORT int fmi2Terminate(struct instance *s) {
    NEEDS(s);
    return terminate(s, "fmi2Terminate");
}

EXPORT int fmi2Reset(struct instance *s) {
    NEEDS(s);
    return reset(s);
}

EXPORT int fmi2DoStep(struct instance *s, double time, double step_size, int no_return) {
    NEEDS(s);
    (void)no_return;
    if (s->phase != STEPPING || s->failed) return allowed(s, "fmi2DoStep", STEPPING);
    return do_step(s, time, step_size);
}

/* -- values ------------------------------------------------------------------------------------ */

EXPORT int fmi2GetReal(struct instance *s, const unsigned *references, size_t n, double *values) {
    NEEDS(s);
    return get_values(s, references, n, values);
}

EXPORT int fmi2SetReal(struct instance *s, const unsigned *references, size_t n, const double *values) {
    NEEDS(s);
    return set_values(s, references, n, values);
}

static int get_whole(struct instance *s, const unsigned *references, size_t n, int *values, int kind) {
    NEEDS(s);
    for (size_t i = 0; i < n; ++i) {
        double value;
        const int status = get_discrete(s, references[i], kind, &value);
        if (status) return status;
        values[i] = (int)value;
    }
    return OK;
}

static int set_whole(struct instance *s, const unsigned *references, size_t n, const int *values, int kind) {
    NEEDS(s);
    if (s->phase == TERMINATED) return after_termination(s);
    int worst = OK;
    for (size_t i = 0; i < n; ++i) {
        const int status = set_value(s, references[i], kind == BOOLEAN ? values[i] != 0 : values[i], kind);
        worst = status > worst ? status : worst;
    }
    return worst;
}

EXPORT int fmi2GetInteger(struct instance *s, const unsigned *r, size_t n, int *v) { return get_whole(s, r, n, v, INTEGER); }
EXPORT int fmi2GetBoolean(struct instance *s, const unsigned *r, size_t n, int *v) { return get_whole(s, r, n, v, BOOLEAN); }
EXPORT int fmi2SetInteger(struct instance *s, const unsigned *r, size_t n, const int *v) {
    NEEDS(s);
    return set_whole(s, r, n, v, INTEGER);
}
EXPORT int fmi2SetBoolean(struct instance *s, const unsigned *r, size_t n, const int *v) {
    NEEDS(s);
    return set_whole(s, r, n, v, BOOLEAN);
}

static int no_strings(struct instance *s, size_t n) {
    return n ? say(s, ERROR, "this FMU has no String variables") : OK;
}

EXPORT int fmi2GetString(struct instance *s, const unsigned *r, size_t n, const char **v) {
    NEEDS(s);
    (void)r, (void)v;
    return no_strings(s, n);
}

EXPORT int fmi2SetString(struct instance *s, const unsigned *r, size_t n, const char *const *v) {
    NEEDS(s);
    (void)r, (void)v;
    return no_strings(s, n);
}

/* -- state ------------------------------------------------------------------------------------- */

EXPORT int fmi2GetFMUstate(struct instance *s, struct snapshot **copy) {
    NEEDS(s);
    return save(s, copy, "fmi2GetFMUstate");
}

EXPORT int fmi2SetFMUstate(struct instance *s, const struct snapshot *copy) {
    NEEDS(s);
    return restore_saved(s, copy, "fmi2SetFMUstate");
}

EXPORT int fmi2FreeFMUstate(struct instance *s, struct snapshot **copy) {
    NEEDS(s);
    return release(copy);
}

EXPORT int fmi2SerializedFMUstateSize(struct instance *s, const struct snapshot *copy, size_t *size) {
    NEEDS(s);
    return serialised_size(s, copy, size, "fmi2SerializedFMUstateSize");
}

EXPORT int fmi2SerializeFMUstate(struct instance *s, const struct snapshot *copy, char *bytes, size_t size) {
    NEEDS(s);
    return serialise(s, copy, bytes, size);
}

EXPORT int fmi2DeSerializeFMUstate(struct instance *s, const char *bytes, size_t size, struct snapshot **copy) {
    NEEDS(s);
    return deserialise(s, bytes, size, copy);
}

/* -- derivatives and status -------------------------------------------------------------------- */

EXPORT int fmi2GetDirectionalDerivative(struct instance *s, const unsigned *unknowns, size_t n_unknowns,
                                        const unsigned *knowns, size_t n_knowns, const double *seed, double *sensitivity) {
    NEEDS(s);
    return directional_derivative(s, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

EXPORT int fmi2SetRealInputDerivatives(struct instance *s, const unsigned *r, size_t n, const int *order, const double *v) {
    NEEDS(s);
    (void)r, (void)order, (void)v;
    return n ? say(s, ERROR, "this FMU holds its inputs and cannot interpolate them") : OK;
}

EXPORT int fmi2GetRealOutputDerivatives(struct instance *s, const unsigned *r, size_t n, const int *order, double *v) {
    NEEDS(s);
    (void)r, (void)order, (void)v;
    return n ? say(s, ERROR, "this FMU gives no derivatives of its outputs by time") : OK;
}

EXPORT int fmi2CancelStep(struct instance *s) {
    NEEDS(s);
    return say(s, ERROR, "there is no step to cancel: every step ends at once");
}

EXPORT int fmi2GetRealStatus(struct instance *s, int kind, double *value) {
    NEEDS(s);
    if (kind != 2) return say(s, DISCARD, "fmi2GetRealStatus tells fmi2LastSuccessfulTime only");
    *value = s->time;
    return OK;
}

EXPORT int fmi2GetBooleanStatus(struct instance *s, int kind, int *value) {
    NEEDS(s);
    if (kind != 3) return say(s, DISCARD, "fmi2GetBooleanStatus tells fmi2Terminated only");
    *value = 0;
    return OK;
}

EXPORT int fmi2GetStatus(struct instance *s, int kind, int *value) {
    NEEDS(s);
    (void)kind, (void)value;
    return say(s, DISCARD, "no step is pending: every step ends at once");
}

EXPORT int fmi2GetIntegerStatus(struct instance *s, int kind, int *value) {
    NEEDS(s);
    (void)kind, (void)value;
    return say(s, DISCARD, "this FMU has no Integer status");
}

EXPORT int fmi2GetStringStatus(struct instance *s, int kind, const char **value) {
    NEEDS(s);
    (void)kind, (void)value;
    return say(s, DISCARD, "this FMU has no String status");
}

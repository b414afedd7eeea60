/* The functions of FMI 2.0 on top of an FMU of FMI 3.0, so that one master runs both. fmi3_instance.c and fmi3_events.c
   come before it. An FMU without events and early returns steps as one of FMI 2.0 does, to the last bit. */

/* -- values ------------------------------------------------------------------------------------ */

EXPORT int fmi2GetReal(struct instance *s, const unsigned *r, size_t n, double *x) {
    MUST(settle(s));
    if (!s->fmu.narrow && !s->fmu.n_specials) return s->fmu.get[FLOAT64](s->inner, r, n, x, n);
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        float narrow;
        if (held(s, r[k], x + k)) continue;
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
    if (!s->fmu.narrow && !s->fmu.n_specials) return s->fmu.set[FLOAT64](s->inner, r, n, x, n);
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        float narrow = (float)x[k];
        bool waits;
        MUST(before_setting(s, r[k], x[k], &waits));
        if (waits) continue;
        if (kind_of(s, r[k]) != FLOAT32)
            WORST(worst, s->fmu.set[FLOAT64](s->inner, r + k, 1, x + k, 1));
        else
            WORST(worst, s->fmu.set[FLOAT32](s->inner, r + k, 1, &narrow, 1));
    }
    return worst;
}

EXPORT int fmi2GetInteger(struct instance *s, const unsigned *r, size_t n, int *x) {
    int worst = OK;
    MUST(settle(s));
    for (size_t k = 0; k < n; ++k) {
        const int kind = kind_of(s, r[k]);
        union any v;
        double whole;
        if (kind < INT8 || kind > UINT64) return say(s, ERROR, "value reference %u is of no integer type", r[k]);
        if (!held(s, r[k], &whole)) {
            WORST(worst, s->fmu.get[kind](s->inner, r + k, 1, &v, 1));
            if (worst > WARNING) return worst;
            whole = number(kind, &v);
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
        bool waits;
        if (kind < INT8 || kind > UINT64) return say(s, ERROR, "value reference %u is of no integer type", r[k]);
        if (x[k] < LOW[kind - INT8] || x[k] > HIGH[kind - INT8])
            return say(s, DISCARD, "value reference %u cannot be %d: its type does not reach so far", r[k], x[k]);
        MUST(before_setting(s, r[k], x[k], &waits));
        if (waits) continue;
        v = typed(kind, x[k]);
        WORST(worst, s->fmu.set[kind](s->inner, r + k, 1, &v, 1));
    }
    return worst;
}

EXPORT int fmi2GetBoolean(struct instance *s, const unsigned *r, size_t n, int *x) {
    int worst = OK;
    MUST(settle(s));
    for (size_t k = 0; k < n; ++k) {
        bool truth = false;
        double kept;
        if (held(s, r[k], &kept)) {
            x[k] = kept != 0;
            continue;
        }
        WORST(worst, s->fmu.get[BOOLEAN](s->inner, r + k, 1, &truth, 1));
        x[k] = truth;
    }
    return worst;
}

EXPORT int fmi2SetBoolean(struct instance *s, const unsigned *r, size_t n, const int *x) {
    int worst = OK;
    for (size_t k = 0; k < n; ++k) {
        bool truth = x[k] != 0, waits;
        MUST(before_setting(s, r[k], truth, &waits));
        if (waits) continue;
        WORST(worst, s->fmu.set[BOOLEAN](s->inner, r + k, 1, &truth, 1));
    }
    return worst;
}

/* -- life cycle -------------------------------------------------------------------------------- */

/* In the table's place of a function that the FMU does not have, and need not. */
EXPORT int fmi3_absent(void) { return ERROR; }

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

static void release(struct instance *s) {
    free(s->name);
    free(s->paces);
    free(s->cells);
    free(s);
}

EXPORT struct instance *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                                        const struct callbacks *callbacks, int visible, int logging) {
    struct instance *s = next ? calloc(1, sizeof *s) : NULL;
    (void)type, (void)resources;
    if (!s) return NULL;
    s->fmu = *next, s->callbacks = callbacks;
    s->name = calloc(1, strlen(name) + 1);
    s->paces = calloc(s->fmu.n_clocks + 1, sizeof *s->paces);
    s->cells = calloc(s->fmu.n_specials + 1, sizeof *s->cells);
    if (s->name && s->paces && s->cells) {
        strcpy(s->name, name);
        begin(s);
        s->inner = s->fmu.instantiate(name, token, s->fmu.resources, visible != 0, logging != 0, s->fmu.events != 0,
                                      s->fmu.early != 0, NULL, 0, s, receive, NULL);
    }
    if (s->inner) return s;
    release(s);
    return NULL;
}

EXPORT void fmi2FreeInstance(struct instance *s) {
    if (!s) return;
    s->fmu.free_instance(s->inner);
    release(s);
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

EXPORT int fmi2ExitInitializationMode(struct instance *s) {
    if (s->fmu.events) MUST(first_ticks(s));
    const int status = s->fmu.exit_initialization(s->inner);
    if (status > WARNING) return status;
    s->course.running = 1, s->course.now = s->start, s->course.open = s->fmu.events; /* it begins with an event */
    MUST(settle(s));
    return status;
}

EXPORT int fmi2Terminate(struct instance *s) { return s->fmu.terminate(s->inner); }

EXPORT int fmi2Reset(struct instance *s) {
    begin(s);
    return s->fmu.reset(s->inner);
}

EXPORT int fmi2DoStep(struct instance *s, double time, double step, int no_return) {
    if (s->course.ended) return DISCARD;
    if (!s->course.running || !(step > 0)) { /* what no master may do is the FMU's to refuse */
        bool event = false, stop = false, early = false;
        double reached = time;
        return s->fmu.do_step(s->inner, time, step, no_return != 0, &event, &stop, &early, &reached);
    }
    return step_with_events(s, time, step, no_return != 0);
}

/* What a step that was refused leaves behind: whether the FMU ended by itself, and how far it came. */
enum { LAST_SUCCESSFUL_TIME = 2, TERMINATED = 3 };

EXPORT int fmi2GetBooleanStatus(struct instance *s, int kind, int *x) {
    if (kind != TERMINATED) return DISCARD;
    *x = s->course.ended != 0;
    return OK;
}

EXPORT int fmi2GetRealStatus(struct instance *s, int kind, double *x) {
    if (kind != LAST_SUCCESSFUL_TIME || !s->course.ended) return DISCARD;
    *x = s->course.reached;
    return OK;
}

/* -- state and derivatives --------------------------------------------------------------------- */

EXPORT int fmi2GetFMUstate(struct instance *s, void **state) {
    return plain(s) ? s->fmu.get_state(s->inner, state) : save(s, state);
}

EXPORT int fmi2SetFMUstate(struct instance *s, void *state) {
    s->course.ended = 0;
    return plain(s) ? s->fmu.set_state(s->inner, state) : restore(s, state);
}

EXPORT int fmi2FreeFMUstate(struct instance *s, void **state) {
    return plain(s) ? s->fmu.free_state(s->inner, state) : discard(s, state);
}

EXPORT int fmi2SerializedFMUstateSize(struct instance *s, void *state, size_t *size) {
    if (plain(s)) return s->fmu.state_size(s->inner, state, size);
    const int status = s->fmu.state_size(s->inner, ((struct saved *)state)->inner, size);
    *size += beside(s);
    return status;
}

EXPORT int fmi2SerializeFMUstate(struct instance *s, void *state, unsigned char *bytes, size_t size) {
    return plain(s) ? s->fmu.serialize(s->inner, state, bytes, size) : serialize(s, state, bytes, size);
}

EXPORT int fmi2DeSerializeFMUstate(struct instance *s, const unsigned char *bytes, size_t size, void **state) {
    return plain(s) ? s->fmu.deserialize(s->inner, bytes, size, state) : deserialize(s, bytes, size, state);
}

EXPORT int fmi2GetDirectionalDerivative(struct instance *s, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                                        size_t n_known, const double *seed, double *sensitivity) {
    MUST(settle(s));
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
NOT_THERE(fmi2GetIntegerStatus, int kind, int *x)
NOT_THERE(fmi2GetStringStatus, int kind, const char **x)

EXPORT int fmi2CancelStep(struct instance *s) { return say(s, ERROR, "fmi2CancelStep has no counterpart in FMI 3.0"); }

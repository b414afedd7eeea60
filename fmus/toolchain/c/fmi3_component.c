/* The WebAssembly component of a native FMU: `fmi3.c` behind the calls that `fmi3_component.wit` declares.

   By the canonical ABI of the component model a list or text comes as an address and a length, in memory that
   `cabi_realloc` gave and that is freed here; an answer of several values is left in memory whose address is returned,
   and its list is freed once the host has read it (`cabi_post_...`). An instance's place is the address of `fmi3.c`'s. */

#define CO_SIMULATION "fmi:fmi3/co-simulation@3.0.0"
#define METHOD CO_SIMULATION "#[method]co-simulation-instance."
#define CALLED(name) __attribute__((export_name(name)))

/* result<list<T>, status> and list<u8> */
struct answer {
    uint8_t failed;
    union {
        uint8_t status;
        struct {
            void *items;
            size_t n;
        };
    };
};

/* result<do-step-result, status>, and any other whose values need eight bytes each */
struct wide_answer {
    uint8_t failed;
    union {
        uint8_t status;
        struct {
            double last_time;
            bool event_needed, terminate, early_return;
        };
    };
};

__attribute__((import_module("fmi:fmi3/callbacks@3.0.0"), import_name("log-message"))) void log_at_host(
    const char *name, size_t n_name, int status, const char *category, size_t n_category, const char *message, size_t n);

__attribute__((import_module("[export]" CO_SIMULATION), import_name("[resource-new]co-simulation-instance"))) int handle_of(
    struct instance *s);

CALLED("cabi_realloc") void *cabi_realloc(void *old, size_t old_size, size_t alignment, size_t size) {
    if (!size) return (void *)alignment; /* an address that nobody reads */
    void *place = realloc(old_size ? old : NULL, size);
    if (!place) __builtin_trap();
    return place;
}

static void free_given(void *items, size_t n) {
    if (n) free(items);
}

/* A given text as C has it, for `free`. */
static char *text_of(char *given, size_t n) {
    char *text = cabi_realloc(NULL, 0, 1, n + 1);
    memcpy(text, given, n);
    text[n] = 0;
    free_given(given, n);
    return text;
}

static void *room_for(size_t n, size_t size) { return cabi_realloc(NULL, 0, 8, n * size); }

static struct answer *list_or_status(int status, void *items, size_t n) {
    static struct answer found;
    found.failed = status > WARNING;
    if (found.failed) {
        free_given(items, n);
        found.status = (uint8_t)status;
    } else {
        found.items = items;
        found.n = n;
    }
    return &found;
}

static void free_answer(struct answer *found) {
    if (!found->failed) free_given(found->items, found->n);
}

static struct wide_answer *only_status(int status) {
    static struct wide_answer found;
    found.failed = 1;
    found.status = (uint8_t)status;
    return &found;
}

/* -- life cycle ------------------------------------------------------------------------------------ */

struct text {
    const char *at;
    size_t n;
};

CALLED("fmi:fmi3/common@3.0.0#get-version") struct text *component_version(void) {
    static struct text found;
    found.at = fmi3GetVersion();
    found.n = strlen(found.at);
    return &found;
}

static void log_here(void *name, int status, const char *category, const char *message) {
    log_at_host(name, strlen(name), status, category, strlen(category), message, strlen(message));
}

struct maybe_instance {
    uint8_t exists;
    int handle;
};

CALLED(CO_SIMULATION "#[static]co-simulation-instance.instantiate-co-simulation")
struct maybe_instance *component_instantiate(char *name, size_t n_name, char *token, size_t n_token, char *resources,
                                             size_t n_resources, int visible, int logging, int event_mode,
                                             int early_return, unsigned *intermediate, size_t n_intermediate) {
    static struct maybe_instance found;
    char *own_name = text_of(name, n_name), *own_token = text_of(token, n_token), *path = text_of(resources, n_resources);
    struct instance *s = fmi3InstantiateCoSimulation(own_name, own_token, path, visible, logging, event_mode, early_return,
                                                     intermediate, n_intermediate, own_name, log_here, NULL);
    free(own_token);
    free(path);
    free_given(intermediate, n_intermediate);
    found.exists = s != NULL;
    if (s)
        found.handle = handle_of(s);
    else
        free(own_name);
    return &found;
}

CALLED(CO_SIMULATION "#[dtor]co-simulation-instance") void component_free(struct instance *s) {
    free(s->environment); /* the name, for the host's log */
    fmi3FreeInstance(s);
}

CALLED(METHOD "set-debug-logging") int component_logging(struct instance *s, int on, struct text *categories, size_t n) {
    const char **names = room_for(n, sizeof *names);
    for (size_t i = 0; i < n; ++i) names[i] = text_of((char *)categories[i].at, categories[i].n);
    const int status = fmi3SetDebugLogging(s, on, n, names);
    for (size_t i = 0; i < n; ++i) free((char *)names[i]);
    free_given(names, n);
    free_given(categories, n);
    return status;
}

CALLED(METHOD "enter-initialization-mode")
int component_enter(struct instance *s, int tolerance_defined, double tolerance, double start, int stop_defined,
                    double stop) {
    return fmi3EnterInitializationMode(s, tolerance_defined, tolerance, start, stop_defined, stop);
}

CALLED(METHOD "do-step")
struct wide_answer *component_step(struct instance *s, double time, double step_size, int no_return) {
    static struct wide_answer found;
    const int status = fmi3DoStep(s, time, step_size, no_return, &found.event_needed, &found.terminate,
                                  &found.early_return, &found.last_time);
    found.failed = status > WARNING;
    if (found.failed) found.status = (uint8_t)status;
    return &found;
}

#define PLAIN(name, call) \
    CALLED(METHOD name) int component_##call(struct instance *s) { return call(s); }
PLAIN("exit-initialization-mode", fmi3ExitInitializationMode)
PLAIN("terminate", fmi3Terminate)
PLAIN("reset", fmi3Reset)
PLAIN("enter-event-mode", fmi3EnterEventMode)
PLAIN("enter-step-mode", fmi3EnterStepMode)
PLAIN("enter-configuration-mode", fmi3EnterConfigurationMode)
PLAIN("exit-configuration-mode", fmi3ExitConfigurationMode)
PLAIN("evaluate-discrete-states", fmi3EvaluateDiscreteStates)

/* -- values ------------------------------------------------------------------------------------ */

#define FREES(name, call) \
    CALLED("cabi_post_" METHOD name) void component_##call##_read(struct answer *found) { free_answer(found); }

#define VALUES(name, kind, value)                                                                                       \
    CALLED(METHOD "get-" name) struct answer *component_get_##kind(struct instance *s, unsigned *r, size_t n) {         \
        value *found = room_for(n, sizeof *found);                                                                      \
        const int status = fmi3Get##kind(s, r, n, found, n);                                                            \
        free_given(r, n);                                                                                               \
        return list_or_status(status, found, n);                                                                        \
    }                                                                                                                   \
    FREES("get-" name, get_##kind)                                                                                      \
    CALLED(METHOD "set-" name) int component_set_##kind(struct instance *s, unsigned *r, size_t n, value *v, size_t m) { \
        const int status = fmi3Set##kind(s, r, n, v, m);                                                                \
        free_given(r, n);                                                                                               \
        free_given(v, m);                                                                                               \
        return status;                                                                                                  \
    }
VALUES("float64", Float64, double)
VALUES("float32", Float32, float)
VALUES("int8", Int8, int8_t)
VALUES("int16", Int16, int16_t)
VALUES("int32", Int32, int32_t)
VALUES("int64", Int64, int64_t)
VALUES("uint8", UInt8, uint8_t)
VALUES("uint16", UInt16, uint16_t)
VALUES("uint32", UInt32, uint32_t)
VALUES("uint64", UInt64, uint64_t)
VALUES("boolean", Boolean, bool)

/* Of clocks, texts and bytes this FMU has none: the functions of `fmi3.c` read no place, and refuse any reference. */
CALLED(METHOD "get-clock") struct answer *component_get_clock(struct instance *s, unsigned *r, size_t n) {
    free_given(r, n);
    return list_or_status(fmi3GetClock(s, NULL, n, NULL), NULL, 0);
}

CALLED(METHOD "get-string") struct answer *component_get_string(struct instance *s, unsigned *r, size_t n) {
    free_given(r, n);
    return list_or_status(fmi3GetString(s, NULL, n, NULL, n), NULL, 0);
}

CALLED(METHOD "get-binary") struct answer *component_get_binary(struct instance *s, unsigned *r, size_t n) {
    free_given(r, n);
    return list_or_status(fmi3GetBinary(s, NULL, n, NULL, NULL, n), NULL, 0);
}

CALLED(METHOD "set-clock") int component_set_clock(struct instance *s, unsigned *r, size_t n, bool *v, size_t m) {
    free_given(r, n);
    free_given(v, m);
    return fmi3SetClock(s, NULL, n, NULL);
}

static void free_texts(struct text *texts, size_t n) {
    for (size_t i = 0; i < n; ++i) free_given((char *)texts[i].at, texts[i].n);
    free_given(texts, n);
}

CALLED(METHOD "set-string") int component_set_string(struct instance *s, unsigned *r, size_t n, struct text *v, size_t m) {
    free_given(r, n);
    free_texts(v, m);
    return fmi3SetString(s, NULL, n, NULL, m);
}

CALLED(METHOD "set-binary") int component_set_binary(struct instance *s, unsigned *r, size_t n, struct text *v, size_t m) {
    free_given(r, n);
    free_texts(v, m);
    return fmi3SetBinary(s, NULL, n, NULL, NULL, m);
}

/* -- state and derivatives --------------------------------------------------------------------- */

CALLED(METHOD "get-fmu-state") struct answer *component_state(struct instance *s) {
    struct snapshot *copy = NULL;
    size_t size = 0;
    uint8_t *bytes = NULL;
    int status = fmi3GetFMUState(s, &copy);
    if (status <= WARNING) status = fmi3SerializedFMUStateSize(s, copy, &size);
    if (status <= WARNING) {
        bytes = room_for(size, 1);
        status = fmi3SerializeFMUState(s, copy, bytes, size);
    }
    fmi3FreeFMUState(s, &copy);
    return list_or_status(status, bytes, size);
}
FREES("get-fmu-state", state)

CALLED(METHOD "set-fmu-state") int component_set_state(struct instance *s, uint8_t *bytes, size_t size) {
    struct snapshot *copy = NULL;
    int status = fmi3DeserializeFMUState(s, bytes, size, &copy);
    if (status <= WARNING) status = fmi3SetFMUState(s, copy);
    fmi3FreeFMUState(s, &copy);
    free_given(bytes, size);
    return status;
}

/* The seed belongs to the knowns of a directional derivative, and to the unknowns of an adjoint one. */
#define DERIVATIVE(name, call, n_found)                                                                                \
    CALLED(METHOD name) struct answer *component_##call(struct instance *s, unsigned *unknowns, size_t n_unknowns,      \
                                                        unsigned *knowns, size_t n_knowns, double *seed,                \
                                                        size_t n_seed) {                                                \
        double *found = room_for(n_found, sizeof *found);                                                               \
        const int status = call(s, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, found, n_found);               \
        free_given(unknowns, n_unknowns);                                                                               \
        free_given(knowns, n_knowns);                                                                                   \
        free_given(seed, n_seed);                                                                                       \
        return list_or_status(status, found, n_found);                                                                  \
    }                                                                                                                   \
    FREES(name, call)
DERIVATIVE("get-directional-derivative", fmi3GetDirectionalDerivative, n_unknowns)
DERIVATIVE("get-adjoint-derivative", fmi3GetAdjointDerivative, n_knowns)

/* -- what this FMU has no use for, as its modelDescription.xml says ------------------------------ */

static int not_here(struct instance *s, const char *name) {
    return say(s, ERROR, "%s is not for this FMU: see the capabilities in its modelDescription.xml", name);
}

CALLED(METHOD "update-discrete-states") struct wide_answer *component_update(struct instance *s) {
    return only_status(not_here(s, "update-discrete-states"));
}

CALLED(METHOD "get-number-of-variable-dependencies") struct wide_answer *component_count(struct instance *s, unsigned r) {
    (void)r;
    return only_status(not_here(s, "get-number-of-variable-dependencies"));
}

CALLED(METHOD "get-variable-dependencies") struct answer *component_dependencies(struct instance *s, unsigned r) {
    (void)r;
    return list_or_status(not_here(s, "get-variable-dependencies"), NULL, 0);
}

#define NO_LIST(name, kind)                                                                       \
    CALLED(METHOD name) struct answer *component_##kind(struct instance *s, void *r, size_t n) { \
        free_given(r, n);                                                                         \
        return list_or_status(not_here(s, name), NULL, 0);                                        \
    }
NO_LIST("get-interval-decimal", interval_decimal)
NO_LIST("get-interval-fraction", interval_fraction)
NO_LIST("get-shift-decimal", shift_decimal)
NO_LIST("get-shift-fraction", shift_fraction)
NO_LIST("get-output-derivatives", output_derivatives)

#define NOT_SET(name, kind)                                                                                      \
    CALLED(METHOD name) int component_##kind(struct instance *s, void *r, size_t n, void *v, size_t m) {         \
        free_given(r, n);                                                                                        \
        free_given(v, m);                                                                                        \
        return not_here(s, name);                                                                                \
    }
NOT_SET("set-interval-decimal", set_interval_decimal)
NOT_SET("set-interval-fraction", set_interval_fraction)
NOT_SET("set-shift-decimal", set_shift_decimal)
NOT_SET("set-shift-fraction", set_shift_fraction)
NOT_SET("set-input-derivatives", set_input_derivatives)

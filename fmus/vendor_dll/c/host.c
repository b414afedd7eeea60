/* The host of an IEEE/CIGRE DLL as one instance of an FMU; fmi2.c stands on it.

   Generated above: VARIABLE (by value reference), the sizes IN_SIZE, OUT_SIZE, PAR_SIZE [bytes], the numbers INTS, FLOATS,
   DOUBLES of states, TEXTS of text parameters, SAMPLE_TIME [s; 0: that of the master], MODE, REGION (stretches of the
   library's own memory, saved with the state), OWN_STATE (whether it was seen to change), VENDOR_FILE, GUID, IDENTITY.

   What lies around the controller, in `circuit`, stands below: no_circuit.c or circuit.c.

   The samples are counted in integers. A step from t to t + h runs the DLL at each sample time from t on before t + h, with
   the inputs of t; its outputs are held until the next sample. */
enum status { OK, WARNING, DISCARD, ERROR, FATAL };
enum phase { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };
enum { TEXT = 4096, GUARD = 64, MARK = 0xA5, BUFFERS = 6 };

static const char *const KIND[] = {"Real", "Integer", "Boolean"};
static const char *const BUFFER[] = {"inputs", "outputs", "parameters", "integer states", "float states", "double states"};
static const size_t SIZE[] = {IN_SIZE, OUT_SIZE, PAR_SIZE, INTS * 4, FLOATS * 4, DOUBLES * 8};

/* As the interface has it. */
struct dll_instance {
    void *inputs, *outputs, *parameters;
    double time;
    uint8_t mode;
    const char *error, *message;
    int32_t *ints;
    float *floats;
    double *doubles;
};
typedef int32_t(CALLED *dll_call)(struct dll_instance *);

struct instance {
    int phase, stale, failed, started, quiet;
    int old, changed; /* the circuit's outputs are older than its inputs; its parameters were set */
    int probing;      /* it is tried what a start at another frequency would bring */
    double time, start, begin, clock; /* samples count from `begin`; the DLL's own time is 0 at `clock` */
    int64_t samples;
    char *name;
    void *environment, *logger;
    library dll;
    char *base;
    dll_call first_call, check, initialise, sample, terminate;
    struct dll_instance model;
    unsigned char *buffer[BUFFERS]; /* between guards that the DLL must not touch */
    unsigned char initial[OUT_SIZE + 1], given[PAR_SIZE + 1];
    double circuit[CIRCUIT_SIZE + 1];
    char last_words[TEXT];
};

/* What fmi2GetFMUstate copies; the library's own memory follows. */
struct snapshot {
    unsigned char identity[16];
    int32_t phase, stale, started, unused;
    double time, start, begin, clock;
    double circuit[CIRCUIT_SIZE + 1];
    int64_t samples;
    const char *base; /* where the library lay whose memory is in it; NULL in another process */
    unsigned char initial[OUT_SIZE + 1], given[PAR_SIZE + 1];
    unsigned char bytes[IN_SIZE + OUT_SIZE + PAR_SIZE + INTS * 4 + FLOATS * 4 + DOUBLES * 8 + MEMORY + 1];
};

#define NEEDS(s) \
    if (!(s)) return ERROR

static const char *const CATEGORY[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};

static void deliver(struct instance *s, int status, const char *text);

static int say(struct instance *s, int status, const char *format, ...) {
    char text[TEXT];
    va_list arguments;
    va_start(arguments, format);
    const int prefix = snprintf(text, sizeof text, "%.200s: ", s->name);
    vsnprintf(text + prefix, sizeof text - (size_t)prefix, format, arguments);
    va_end(arguments);
    if (status >= ERROR) s->failed = 1;
    if (s->logger && (status >= WARNING || !s->quiet)) deliver(s, status, text);
    return status;
}

static int set_logging(struct instance *s, int on, size_t n, const char *const categories[]) {
    (void)n, (void)categories;
    s->quiet = !on;
    return OK;
}

/* -- values in memory -------------------------------------------------------------------------- */

static double load(const void *at, int type) {
    switch (type) {
#define LOAD(number, c_type) \
    case number: { \
        c_type v; \
        memcpy(&v, at, sizeof v); \
        return (double)v; \
    }
        LOAD(1, int8_t) LOAD(2, int8_t) LOAD(3, uint8_t) LOAD(4, int16_t) LOAD(5, uint16_t)
        LOAD(6, int32_t) LOAD(7, uint32_t) LOAD(8, float) LOAD(9, double)
    }
    return 0;
}

static void store(void *at, int type, double value) {
    switch (type) {
#define STORE(number, c_type) \
    case number: { \
        const c_type v = (c_type)value; \
        memcpy(at, &v, sizeof v); \
        return; \
    }
        STORE(1, int8_t) STORE(2, int8_t) STORE(3, uint8_t) STORE(4, int16_t) STORE(5, uint16_t)
        STORE(6, int32_t) STORE(7, uint32_t) STORE(8, float) STORE(9, double)
    }
}

/* Least and greatest value of a whole type. */
static const double LEAST[] = {0, -128, -128, 0, -32768, 0, -2147483648.0, 0};
static const double MOST[] = {0, 127, 127, 255, 32767, 65535, 2147483647.0, 4294967295.0};

static void *place_of(struct instance *s, const struct variable *v) {
    switch (v->role) {
        case INPUT:
        case HELD_INPUT:
        case CONSTANT_INPUT: return s->buffer[0] + v->offset;
        case OUTPUT:
        case HELD: return s->buffer[1] + v->offset;
        case PARAMETER: return (s->started ? s->buffer[2] : s->given) + v->offset;
        case INITIAL: return s->initial + v->offset;
        case INT_STATE: return s->buffer[3] + v->offset;
        case FLOAT_STATE: return s->buffer[4] + v->offset;
        case DOUBLE_STATE: return s->buffer[5] + v->offset;
        case MEMORY_STATE: return s->base + v->offset;
        case SAMPLES: return &s->samples;
    }
    return (unsigned char *)(s->circuit + v->offset);
}

/* -- calls of the DLL -------------------------------------------------------------------------- */

static int touched(struct instance *s, const char *call) {
    for (int k = 0; k < BUFFERS; ++k)
        for (int i = 0; i < GUARD; ++i)
            if (s->buffer[k][-1 - i] != MARK || s->buffer[k][SIZE[k] + (size_t)i] != MARK)
                return say(s, ERROR, "%s wrote outside of its %s (%zu bytes): %s; the DLL declares fewer than it uses", call,
                           BUFFER[k], SIZE[k], s->buffer[k][-1 - i] != MARK ? "before the first" : "after the last");
    return OK;
}

/* One call; what the DLL says is passed on in its own words. */
static int called(struct instance *s, dll_call f, const char *call) {
    if (!f) return OK;
    s->model.error = s->model.message = NULL;
    const int32_t answer = f(&s->model);
    int status = touched(s, call);
    if (status) return status;
    const char *words = answer == 2 && s->model.error ? s->model.error : s->model.message;
    words = words && *words ? words : "(no message)";
    if (answer == 2) return say(s, ERROR, "%s at t = %.9g s ends with an error of the DLL: %.3000s", call, s->model.time, words);
    if (answer == 1) {
        if (!strncmp(words, s->last_words, TEXT - 1)) return OK; /* once is enough */
        snprintf(s->last_words, TEXT, "%.4000s", words);
        say(s, WARNING, "%s at t = %.9g s: %.3000s", call, s->model.time, words);
        return OK;
    }
    if (answer) return say(s, ERROR, "%s returns %d; the interface knows 0 (well), 1 (a message) and 2 (an error)", call, answer);
    return OK;
}

static const char *not_finite(struct instance *s) {
    for (int i = 0; i < NV; ++i)
        if ((VARIABLE[i].role == OUTPUT || VARIABLE[i].role == DOUBLE_STATE || VARIABLE[i].role == FLOAT_STATE) &&
            !isfinite(load(place_of(s, VARIABLE + i), VARIABLE[i].type)))
            return VARIABLE[i].name;
    return NULL;
}

/* What circuit.c or no_circuit.c gives. */
static int circuit_start(struct instance *s);
static int circuit_advance(struct instance *s, double from, double to);
static void circuit_before(struct instance *s, double time);
static void circuit_after(struct instance *s);
static void circuit_refresh(struct instance *s, double time);
static int circuit_check(struct instance *s);

static int start_dll(struct instance *s) {
    s->stale = 0;
    s->begin = s->start;
    s->clock = 0;
    s->samples = 0;
    if (!s->started) {
        memcpy(s->buffer[2], s->given, PAR_SIZE);
        s->started = 1;
        const int status = called(s, s->first_call, "Model_FirstCall");
        if (status) return status;
    }
    memcpy(s->buffer[2], s->given, PAR_SIZE);
    for (int k = 3; k < BUFFERS; ++k) memset(s->buffer[k], 0, SIZE[k]);
    memcpy(s->buffer[1], s->initial, OUT_SIZE);
    s->model.time = s->start;
    int status = called(s, s->check, "Model_CheckParameters");
    if (status) return status;
    for (int i = 0; i < NV; ++i)
        if (VARIABLE[i].role == PARAMETER) {
            const double given = load(s->given + VARIABLE[i].offset, VARIABLE[i].type);
            const double now = load(s->buffer[2] + VARIABLE[i].offset, VARIABLE[i].type);
            if (given != now)
                say(s, WARNING, "Model_CheckParameters changed parameter %s from %.9g to %.9g", VARIABLE[i].name, given, now);
        }
    status = called(s, s->initialise, "Model_Initialize");
    if (status) return status;
    const char *bad = not_finite(s);
    if (bad) return say(s, ERROR, "Model_Initialize gives no finite value for %s; check parameters and initial outputs", bad);
    return OK;
}

static int initialise(struct instance *s) {
    const int status = start_dll(s), text = status < ERROR ? -1 : unread();
    if (text >= 0)
        say(s, ERROR, "its text parameter %s names the file %.1000s, which it cannot read here: it may be hidden from an FMU's process; "
                      "build the FMU with the file's path given, which takes it along", NAMES[text], word(text));
    return status < ERROR ? circuit_start(s) : status;
}

/* Samples before a time; a sample that lies on it within a millionth is not before it. */
static int64_t samples_before(const struct instance *s, double time, double sample_time) {
    return (int64_t)ceil((time - s->begin) / sample_time - 1e-6);
}

/* What happens between two times. */
static int pass(struct instance *s, double time, double step_size) {
    int64_t until = s->samples + 1;
    if (SAMPLE_TIME > 0) until = samples_before(s, time + step_size, SAMPLE_TIME);
    if (until - s->samples > 10000000)
        return say(s, DISCARD, "communication step size %g s has over ten million samples of %g s", step_size, SAMPLE_TIME);
    double now = time;
    for (; s->samples < until; ++s->samples) {
        const double at = SAMPLE_TIME > 0 ? s->begin + (double)s->samples * SAMPLE_TIME : time;
        int status = circuit_advance(s, now, at);
        if (status) return status;
        now = at > now ? at : now;
        circuit_before(s, at);
        s->model.time = at - s->clock;
        status = called(s, s->sample, "Model_Outputs");
        if (status) return status;
        circuit_after(s);
    }
    const int status = circuit_advance(s, now, time + step_size);
    if (status) return status;
    const char *bad = not_finite(s);
    if (bad) return say(s, ERROR, "%s is no longer finite after t = %.9g s", bad, time);
    s->time = time + step_size;
    return OK;
}

static int do_step(struct instance *s, double time, double step_size) {
    if (!(step_size > 0) || !isfinite(step_size))
        return say(s, ERROR, "communication step size %g s; it must exceed 0", step_size);
    int status = s->changed ? circuit_check(s) : OK;
    s->changed = 0;
    if (!status) status = pass(s, time, step_size);
    if (!status) circuit_refresh(s, s->time);
    return status;
}

/* -- life cycle -------------------------------------------------------------------------------- */

static void set_texts(unsigned char *parameters) {
    for (int i = 0; i < TEXTS; ++i) {
        const char *text = word(i);
        memcpy(parameters + TEXT_AT[i], &text, sizeof text);
    }
}

static void set_to_start(struct instance *s) {
    for (int k = 0; k < BUFFERS; ++k) memset(s->buffer[k], 0, SIZE[k]);
    memset(s->initial, 0, sizeof s->initial);
    memset(s->given, 0, sizeof s->given);
    s->phase = INSTANTIATED;
    s->stale = 1;
    s->failed = s->started = s->changed = 0;
    s->samples = 0;
    s->time = s->start = s->begin = s->clock = 0;
    s->old = 1;
    memset(s->circuit, 0, sizeof s->circuit);
    s->last_words[0] = 0;
    for (int i = 0; i < NV; ++i)
        if (VARIABLE[i].role <= INPUT || VARIABLE[i].role == CIRCUIT_PARAMETER || VARIABLE[i].role == CIRCUIT_INPUT ||
            VARIABLE[i].role == CONSTANT_INPUT)
            store(place_of(s, VARIABLE + i), VARIABLE[i].type, VARIABLE[i].start);
    set_texts(s->given);
    for (int i = 0; i < TEXT_INPUTS; ++i) memcpy(s->buffer[0] + TEXT_INPUT_AT[i], &EMPTY, sizeof EMPTY);
}

static void unload(struct instance *s) {
    if (!s->dll.handle) return;
    if (s->started) called(s, s->terminate, "Model_Terminate");
    close_copy(&s->dll);
    s->dll.handle = NULL;
    s->base = NULL;
}

static int load_dll(struct instance *s) {
    char why[TEXT];
    if (!open_vendor(&s->dll, why, sizeof why)) return say(s, ERROR, "the DLL %s cannot be loaded: %.3000s", VENDOR_FILE, why);
    s->base = loaded_at(&s->dll);
    s->first_call = (dll_call)function(&s->dll, "Model_FirstCall");
    s->check = (dll_call)function(&s->dll, "Model_CheckParameters");
    s->initialise = (dll_call)function(&s->dll, "Model_Initialize");
    s->sample = (dll_call)function(&s->dll, "Model_Outputs");
    s->terminate = (dll_call)function(&s->dll, "Model_Terminate");
    if (!s->initialise || !s->sample || !s->base)
        return say(s, ERROR, "the DLL %s has no Model_Initialize or no Model_Outputs", VENDOR_FILE);
    return OK;
}

static int prepare(struct instance *s, const char *resources) { return (void)s, (void)resources, OK; }

static void destroy(struct instance *s) {
    if (!s) return;
    s->logger = NULL;
    unload(s);
    for (int k = 0; k < BUFFERS; ++k)
        if (s->buffer[k]) free(s->buffer[k] - GUARD);
    free(s->name);
    free(s);
}

static struct instance *create(const char *name) {
    struct instance *s = calloc(1, sizeof *s);
    if (!s) return NULL;
    int whole = (s->name = malloc(strlen(name) + 1)) != NULL;
    for (int k = 0; k < BUFFERS; ++k) {
        unsigned char *room = malloc(SIZE[k] + 2 * GUARD);
        whole = whole && room;
        if (!room) continue;
        memset(room, MARK, SIZE[k] + 2 * GUARD);
        s->buffer[k] = room + GUARD;
    }
    if (!whole) {
        destroy(s);
        return NULL;
    }
    strcpy(s->name, name);
    struct dll_instance *m = &s->model;
    m->inputs = s->buffer[0], m->outputs = s->buffer[1], m->parameters = s->buffer[2], m->mode = MODE;
    m->ints = (void *)s->buffer[3], m->floats = (void *)s->buffer[4], m->doubles = (void *)s->buffer[5];
    set_to_start(s);
    return s;
}

static const char *const PHASE[] = {"before initialisation", "in initialisation", "after initialisation", "after termination"};

static int allowed(struct instance *s, const char *call, int phase) {
    if (s->phase != phase) return say(s, ERROR, "%s is not allowed %s", call, PHASE[s->phase]);
    if (s->failed) return say(s, ERROR, "%s after an error: restore a state, reset or free the instance", call);
    return s->dll.handle ? OK : load_dll(s);
}

static int set_experiment(struct instance *s, const char *call, double start, int stop_defined, double stop) {
    const int status = allowed(s, call, INSTANTIATED);
    if (status) return status;
    if (!isfinite(start) || (stop_defined && !(stop > start)))
        return say(s, ERROR, "the experiment from %g s to %g s: it must end after it starts", start, stop);
    s->time = s->start = start;
    return OK;
}

static int terminate(struct instance *s, const char *call) {
    const int status = allowed(s, call, STEPPING);
    if (!status) s->phase = TERMINATED;
    return status;
}

/* A fresh copy of the library: only that brings its own variables back to where they began. */
static int reset(struct instance *s) {
    unload(s);
    set_to_start(s);
    return OK;
}

static int end_initialisation(struct instance *s, const char *call) {
    int status = allowed(s, call, INITIALISING);
    if (!status && s->stale) status = initialise(s);
    s->phase = STEPPING;
    return status;
}

/* -- values ------------------------------------------------------------------------------------ */

static int readable(struct instance *s, unsigned reference, int kind) {
    if (reference >= NV)
        return say(s, ERROR, "there is no variable with value reference %u; modelDescription.xml lists them", reference);
    if (VARIABLE[reference].kind != kind)
        return say(s, ERROR, "%s is no %s variable; call the function of its own type", VARIABLE[reference].name, KIND[kind]);
    if (VARIABLE[reference].role == MEMORY_STATE && !s->base) return say(s, ERROR, "the DLL is not loaded before initialisation");
    return OK;
}

static int get_discrete(struct instance *s, unsigned reference, int kind, double *value) {
    int status = readable(s, reference, kind);
    const struct variable *v = VARIABLE + reference;
    if (!status && s->phase == INITIALISING && s->stale && v->role > INITIAL && v->role != CIRCUIT_PARAMETER)
        status = initialise(s);
    if (status) return status;
    if (v->role == CIRCUIT_VALUE && s->old) circuit_refresh(s, s->time);
    *value = v->role == SAMPLES ? (double)s->samples : load(place_of(s, v), v->type);
    return OK;
}

static int get_values(struct instance *s, const unsigned *references, size_t n, double *values) {
    for (size_t i = 0; i < n; ++i) {
        const int status = get_discrete(s, references[i], REAL, values + i);
        if (status) return status;
    }
    return OK;
}

static int set_value(struct instance *s, unsigned reference, double value, int kind) {
    const int status = readable(s, reference, kind);
    if (status) return status;
    const struct variable *v = VARIABLE + reference;
    const int parameter = v->role == PARAMETER || v->role == CIRCUIT_PARAMETER;
    if (v->role == OUTPUT || v->role == SAMPLES || v->role == INT_STATE || v->role == CIRCUIT_VALUE || v->role == HELD_INPUT)
        return say(s, ERROR, "%s is computed by the FMU and cannot be set", v->name);
    if (s->phase < STEPPING && v->role > INPUT && v->role != CIRCUIT_INPUT && v->role != CONSTANT_INPUT && !parameter)
        return say(s, ERROR, "state %s can be set only after initialisation, which computes it", v->name);
    if (s->phase >= STEPPING && (v->role == INITIAL || (parameter && !v->tunable)))
        return say(s, ERROR, "parameter %s is fixed; it can be set only before the end of initialisation", v->name);
    if (!isfinite(value)) return say(s, DISCARD, "%s = %g; it must be a finite number", v->name, value);
    if (v->type < 8 && (value < LEAST[v->type] || value > MOST[v->type]))
        return say(s, DISCARD, "%s = %.10g; its type in the DLL holds %.10g to %.10g", v->name, value, LEAST[v->type], MOST[v->type]);
    if (parameter && (value < v->minimum || value > v->maximum))
        return say(s, DISCARD, "parameter %s = %g; %s allows %g to %g", v->name, value,
                   v->role == PARAMETER ? "the DLL" : "the circuit", v->minimum, v->maximum);
    if (v->role == PARAMETER) store(s->given + v->offset, v->type, value);
    store(place_of(s, v), v->type, value);
    s->old = 1;
    s->changed |= v->role == CIRCUIT_PARAMETER;
    if (s->phase < STEPPING && v->role != CIRCUIT_INPUT) s->stale = 1; /* the start does not ask what its partners do */
    return OK;
}

static int after_termination(struct instance *s) { return say(s, ERROR, "after termination nothing can be set"); }

static int set_values(struct instance *s, const unsigned *references, size_t n, const double *values) {
    if (s->phase == TERMINATED) return after_termination(s);
    int worst = OK;
    for (size_t i = 0; i < n; ++i) {
        const int status = set_value(s, references[i], values[i], REAL);
        worst = status > worst ? status : worst;
    }
    return worst;
}

/* -- state ------------------------------------------------------------------------------------- */

static int save(struct instance *s, struct snapshot **copy, const char *call) {
    if (!copy) return say(s, ERROR, "%s needs the address of a pointer", call);
    if (!s->dll.handle && load_dll(s)) return ERROR;
    if (!*copy) *copy = calloc(1, sizeof **copy);
    if (!*copy) return say(s, ERROR, "no memory for a copy of the state (%zu bytes)", sizeof **copy);
    struct snapshot *c = *copy;
    memcpy(c->identity, IDENTITY, sizeof c->identity);
    c->phase = s->phase, c->stale = s->stale, c->started = s->started;
    c->time = s->time, c->start = s->start, c->samples = s->samples, c->base = s->base;
    c->begin = s->begin, c->clock = s->clock;
    memcpy(c->circuit, s->circuit, sizeof c->circuit);
    memcpy(c->initial, s->initial, sizeof c->initial);
    memcpy(c->given, s->given, sizeof c->given);
    unsigned char *to = c->bytes;
    for (int k = 0; k < BUFFERS; to += SIZE[k++]) memcpy(to, s->buffer[k], SIZE[k]);
    for (int k = 0; k < REGIONS; to += REGION[k++][1]) memcpy(to, s->base + REGION[k][0], REGION[k][1]);
    return OK;
}

static int restore_saved(struct instance *s, const struct snapshot *c, const char *call) {
    if (!c) return say(s, ERROR, "%s needs a state that was saved before", call);
    if (memcmp(c->identity, IDENTITY, sizeof c->identity) || c->phase < INSTANTIATED || c->phase > TERMINATED)
        return say(s, ERROR, "the FMU state to restore was not saved by this FMU");
    if (!s->dll.handle && load_dll(s)) return ERROR;
    s->phase = c->phase, s->stale = c->stale, s->started = c->started;
    s->time = c->time, s->start = c->start, s->samples = c->samples;
    s->begin = c->begin, s->clock = c->clock, s->old = 1;
    memcpy(s->circuit, c->circuit, sizeof s->circuit);
    memcpy(s->initial, c->initial, sizeof c->initial);
    memcpy(s->given, c->given, sizeof c->given);
    const unsigned char *from = c->bytes;
    for (int k = 0; k < BUFFERS; from += SIZE[k++]) memcpy(s->buffer[k], from, SIZE[k]);
    for (int k = 0; c->base == s->base && k < REGIONS; from += REGION[k++][1]) memcpy(s->base + REGION[k][0], from, REGION[k][1]);
    /* Texts lie in this process, wherever the state was saved. */
    set_texts(s->given);
    set_texts(s->buffer[2]);
    for (int i = 0; i < TEXT_INPUTS; ++i) memcpy(s->buffer[0] + TEXT_INPUT_AT[i], &EMPTY, sizeof EMPTY);
    s->failed = 0;
    return OK;
}

static int release(struct snapshot **copy) {
    if (copy) {
        free(*copy);
        *copy = NULL;
    }
    return OK;
}

static int own_memory(struct instance *s) {
    return say(s, ERROR, "this DLL keeps state in its own memory, which has no meaning in another process");
}

static int serialised_size(struct instance *s, const struct snapshot *copy, size_t *size, const char *call) {
    if (OWN_STATE) return own_memory(s);
    if (!copy || !size) return say(s, ERROR, "%s needs a saved state and a place for its size", call);
    *size = sizeof *copy;
    return OK;
}

static int serialise(struct instance *s, const struct snapshot *copy, void *bytes, size_t size) {
    if (OWN_STATE) return own_memory(s);
    if (!copy || !bytes || size < sizeof *copy)
        return say(s, ERROR, "a saved state takes %zu bytes; %zu were given", sizeof *copy, size);
    memcpy(bytes, copy, sizeof *copy);
    return OK;
}

static int deserialise(struct instance *s, const void *bytes, size_t size, struct snapshot **copy) {
    if (OWN_STATE) return own_memory(s);
    if (!bytes || !copy || size != sizeof **copy)
        return say(s, ERROR, "a saved state has %zu bytes; %zu were given", sizeof **copy, size);
    if (!*copy) *copy = malloc(sizeof **copy);
    if (!*copy) return say(s, ERROR, "no memory for a copy of the state (%zu bytes)", size);
    memcpy(*copy, bytes, size);
    (*copy)->base = NULL;
    return OK;
}

static int directional_derivative(struct instance *s, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                                  size_t n_knowns, const double *seed, double *sensitivity) {
    (void)unknowns, (void)n_unknowns, (void)knowns, (void)n_knowns, (void)seed, (void)sensitivity;
    return say(s, ERROR, "this FMU has no directional derivatives: its equations are in a DLL");
}

/* One instance of a native FMU: variables, life cycle, errors. The FMI functions of either version stand on it.

   Above stand NAME, START, PARAMETER, RULE, the sizes NR (rules), TEXT (longest message), INTERNAL_STEP (a value
   reference), GUID and IDENTITY: generated for one model, or by `model.c` for a model that is read (TAPE).
   `slave.py` says the same in Python for Python-backed FMUs. */
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define NV (DX + NX)
#ifndef OUTPUTS_WAIT /* whether a step leaves outputs to whoever reads them */
#define OUTPUTS_WAIT 0
#endif
enum status { OK, WARNING, DISCARD, ERROR, FATAL };
enum phase { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };
enum { MOST_PARTS = 1000000 }; /* internal steps in one communication step */

struct instance {
    double *z;
    int phase;
    int changed; /* parameters were set that nothing was computed from yet */
    int stale;   /* outputs are older than what they depend on */
    int failed;  /* an error after which only a restored state, a reset or the end can follow */
    double time, step_size, part;
    int parts;
    char *name;
    void *environment, *logger;
    int quiet; /* messages below an error are not wanted */
    double *work, *before;
    struct beside *beside; /* what keeps its parameters beside others', as `stack.c` has it; NULL where they changed since */
    void *own_beside;      /* memory of the one that it leads */
#ifdef TAPE
    struct model model;
#endif
};

/* What fmi2GetFMUstate copies. */
struct snapshot {
    unsigned char identity[16];
    int32_t phase, changed;
    double time, z[];
};
#define SNAPSHOT (sizeof(struct snapshot) + NV * sizeof(double))

/* A call without an instance is refused; there is nobody to log to. */
#define NEEDS(s) \
    if (!(s)) return ERROR

/* Of a message, by its status. */
static const char *const CATEGORY[] = {"logAll", "logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal"};

static void deliver(struct instance *s, int status, const char *text); /* each version of FMI has its own logger */

/* Log a message and return its status. */
static int say(struct instance *s, int status, const char *format, ...) {
    char text[TEXT];
    va_list arguments;
    va_start(arguments, format);
    const int prefix = snprintf(text, sizeof text, "%.200s: ", s->name);
    vsnprintf(text + prefix, sizeof text - (size_t)prefix, format, arguments);
    va_end(arguments);
    if (status >= ERROR) s->failed = 1;
    if (s->logger && (status >= ERROR || !s->quiet)) deliver(s, status, text);
    return status;
}

/* Which messages below an error are wanted; none named means all. */
static int set_logging(struct instance *s, int on, size_t n, const char *const categories[]) {
    int wanted = n == 0;
    for (size_t i = 0; i < n; ++i)
        wanted |= !strcmp(categories[i], CATEGORY[OK]) || !strcmp(categories[i], CATEGORY[WARNING]) ||
                  !strcmp(categories[i], CATEGORY[DISCARD]);
    s->quiet = !(on && wanted);
    return OK;
}

/* What was kept for the next step is of other parameters. */
static void begin_anew(struct instance *s) {
    s->step_size = 0;
    s->beside = NULL;
}

static void set_to_start(struct instance *s) {
    memset(s->z, 0, NV * sizeof *s->z);
    for (int i = 0; i < NP; ++i) s->z[i] = START[i];
    for (int i = 0; i < NU; ++i) s->z[U + i] = START[NP + i];
    s->phase = INSTANTIATED;
    s->changed = s->stale = 1;
    s->failed = 0;
    s->time = 0;
    begin_anew(s);
}

/* An instance that can log; `prepare` makes it one of the model. */
static struct instance *create(const char *name) {
    struct instance *s = calloc(1, sizeof *s);
    const size_t length = strlen(name) + 1;
    if (s && !(s->name = malloc(length))) {
        free(s);
        return NULL;
    }
    if (s) memcpy(s->name, name, length);
    return s;
}

static void destroy(struct instance *s) {
    if (!s) return;
#ifdef TAPE
    forget(&s->model);
#endif
    free(s->name);
    free(s->work);
    free(s->z);
    free(s->before);
    free(s->own_beside);
    free(s);
}

static int prepare(struct instance *s, const char *resources) {
#ifdef TAPE
    const char *fault = read_model(&s->model, resources);
    if (fault) return say(s, ERROR, "the FMU's resources cannot be used: %.200s: %s; unpack the FMU again", resources ? resources : "(none)", fault);
    s->work = calloc((size_t)workspace_size(s->model.tape) + 1, sizeof *s->work);
    if (s->work) {
        begin(s->model.tape, s->work);
        OF(s->work)->outputs_when_read = OUTPUTS_WAIT;
    }
#else
    (void)resources;
    s->work = calloc((size_t)workspace_size() + 1, sizeof *s->work);
#endif
    if (s->work) s->z = calloc((size_t)NV + 1, sizeof *s->z), s->before = calloc((size_t)NX + 1, sizeof *s->before);
    if (!s->z || !s->before) return say(s, ERROR, "no memory for an instance");
    set_to_start(s);
    return OK;
}

/* Refuse parameters that break a rule of the model. */
static int check_rules(struct instance *s, int status) {
    double margins[NR + 1];
    requirements(s->z, s->work, margins);
    for (int i = 0; i < NR; ++i)
        if (!(margins[i] > 0)) status = say(s, ERROR, "parameters cannot be used: %s", RULE[i]);
    return status;
}

/* Bring everything that is computed up to date. */
static int refresh(struct instance *s) {
    int status = OK;
    if (s->changed && s->phase < STEPPING) initialise(s->z, s->work);
    if (s->changed && s->phase == STEPPING) status = check_rules(s, OK); /* before partners see what follows from it */
    s->changed = s->stale = 0;
    outputs(s->z, s->work);
    return status;
}

/* -- values ------------------------------------------------------------------------------------ */

static int unknown_reference(struct instance *s, unsigned reference) {
    return say(s, ERROR, "there is no variable with value reference %u; modelDescription.xml lists them", reference);
}

static int wrong_kind(struct instance *s, unsigned reference, int kind) {
    return say(s, ERROR, "%s is no %s variable; call the function of its own type", NAME[reference], KIND[kind]);
}

static int kind_of(struct instance *s, unsigned reference) { return reference < (unsigned)NP ? PARAMETER[reference].kind : REAL; }

static int get_values(struct instance *s, const unsigned *references, size_t n, double *values) {
    int status = OK, rates_wanted = 0;
    for (size_t i = 0; i < n; ++i) {
        if (references[i] >= NV) return unknown_reference(s, references[i]);
        if (kind_of(s, references[i]) != REAL) return wrong_kind(s, references[i], REAL);
        rates_wanted |= references[i] >= DX;
    }
#ifdef TAPE
    if (s->stale && !s->changed && s->phase == STEPPING && glance(s->z, s->work, references, n, values)) return OK;
#endif
    if (s->stale) status = refresh(s);
    if (rates_wanted) derivatives(s->z, s->work);
    for (size_t i = 0; i < n; ++i) values[i] = s->z[references[i]];
    return status;
}

static int get_discrete(struct instance *s, unsigned reference, int kind, double *value) {
    if (reference >= NV) return unknown_reference(s, reference);
    if (kind_of(s, reference) != kind) return wrong_kind(s, reference, kind);
    *value = s->z[reference];
    return OK;
}

static int set_parameter(struct instance *s, unsigned reference, double value, int kind) {
    const struct parameter *p = &PARAMETER[reference];
    const char *name = NAME[reference];
    if (p->kind != kind) return wrong_kind(s, reference, kind);
    if (s->phase >= STEPPING && !p->tunable)
        return say(s, ERROR, "parameter %s is fixed; it can be set only before the end of initialisation", name);
    if (!isfinite(value)) return say(s, DISCARD, "parameter %s = %g; it must be a finite number", name, value);
    if (value < p->minimum) return say(s, DISCARD, "parameter %s = %g; it must be at least %g", name, value, p->minimum);
    if (value > p->maximum) return say(s, DISCARD, "parameter %s = %g; it must be at most %g", name, value, p->maximum);
    s->z[reference] = value;
    s->changed = s->stale = 1;
    begin_anew(s); /* internal_step may be what changed */
    return OK;
}

/* Set a parameter within its bounds, an input, or a state of a running instance (our extension of FMI). */
static int set_value(struct instance *s, unsigned reference, double value, int kind) {
    if (reference < NP) return set_parameter(s, reference, value, kind);
    if (reference >= NV) return unknown_reference(s, reference);
    if (kind != REAL) return wrong_kind(s, reference, kind);
    if (reference >= X && reference < Y && s->phase < STEPPING)
        return say(s, ERROR, "state %s can be set only after initialisation, which computes it", NAME[reference]);
    if (reference < U || reference >= Y)
        return say(s, ERROR, "%s is computed by the FMU and cannot be set", NAME[reference]);
    if (!isfinite(value))
        return say(s, DISCARD, "%s = %g; it must be a finite number", NAME[reference], value);
    s->z[reference] = value;
    s->stale = 1;
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

/* -- life cycle -------------------------------------------------------------------------------- */

static const char *const PHASE[] = {"before initialisation", "in initialisation", "after initialisation", "after termination"};

static int allowed(struct instance *s, const char *call, int phase) {
    if (s->phase != phase) return say(s, ERROR, "%s is not allowed %s", call, PHASE[s->phase]);
    if (s->failed) return say(s, ERROR, "%s after an error: restore a state, reset or free the instance", call);
    return OK;
}

/* The times of the experiment, before initialisation. */
static int set_experiment(struct instance *s, const char *call, double start, int stop_defined, double stop) {
    const int status = allowed(s, call, INSTANTIATED);
    if (status) return status;
    if (!isfinite(start) || (stop_defined && !(stop > start)))
        return say(s, ERROR, "the experiment from %g s to %g s: it must end after it starts", start, stop);
    s->time = start;
    return OK;
}

static int terminate(struct instance *s, const char *call) {
    const int status = allowed(s, call, STEPPING);
    if (!status) s->phase = TERMINATED;
    return status;
}

static int reset(struct instance *s) {
    set_to_start(s);
    return OK;
}

static int end_initialisation(struct instance *s, const char *call) {
    int status = allowed(s, call, INITIALISING);
    if (status) return status;
    status = s->stale || s->changed ? refresh(s) : OK;
    status = check_rules(s, status);
    for (int i = 0; i < DX; ++i)
        if (!isfinite(s->z[i])) {
            status = say(s, ERROR, "initialisation gives no finite value for %s; check the parameters", NAME[i]);
            break;
        }
    s->phase = STEPPING;
    return status;
}

static const char *cause_of_divergence(struct instance *s) {
    for (int i = U; i < X; ++i)
        if (!isfinite(s->z[i])) return "an input is not a finite number";
    return "the solution diverges";
}

/* One communication step. A step that cannot be done leaves the instance where it was. */
static int do_step(struct instance *s, double time, double step_size) {
    if (step_size != s->step_size || !(step_size > 0)) {
        const double longest = MOST_PARTS * s->z[INTERNAL_STEP];
        if (!(step_size > 0) || !isfinite(step_size))
            return say(s, ERROR, "communication step size %g s; it must exceed 0", step_size);
        if (step_size > longest)
            return say(s, DISCARD, "communication step size %g s; it must be at most %g s", step_size, longest);
        s->parts = (int)ceil(step_size / s->z[INTERNAL_STEP] - 1e-9);
        s->parts = s->parts > 1 ? s->parts : 1;
        s->step_size = step_size;
        s->part = step_size / s->parts;
    }
    if (s->changed) {
        s->changed = 0;
        if (check_rules(s, OK)) return ERROR;
    }
    memcpy(s->before, s->z + X, NX * sizeof(double));
    const int bad = advance(s->z, s->part, s->parts, s->work);
    if (bad) {
        say(s, DISCARD, "state %s is no longer finite after t = %.6g s: %s", NAME[X + bad - 1], time,
            cause_of_divergence(s));
        memcpy(s->z + X, s->before, NX * sizeof(double));
        s->stale = 1;
        return DISCARD;
    }
    s->stale = OUTPUTS_WAIT;
    s->time = time + step_size;
    return OK;
}

/* -- state ------------------------------------------------------------------------------------- */

static void take_snapshot(struct instance *s, struct snapshot *copy) {
    if (s->stale && s->phase < STEPPING) refresh(s);
    memcpy(copy->identity, IDENTITY, sizeof copy->identity);
    copy->phase = s->phase;
    copy->changed = s->changed || s->failed;
    copy->time = s->time;
    memcpy(copy->z, s->z, NV * sizeof *s->z);
}

static int restore(struct instance *s, const struct snapshot *copy) {
    if (memcmp(copy->identity, IDENTITY, sizeof copy->identity) || copy->phase < INSTANTIATED || copy->phase > TERMINATED)
        return say(s, ERROR, "the FMU state to restore was not saved by this FMU");
    s->phase = copy->phase;
    s->changed = copy->changed;
    s->time = copy->time;
    memcpy(s->z, copy->z, NV * sizeof *s->z);
    s->stale = 1;
    s->failed = 0;
    begin_anew(s);
    return OK;
}

static int no_memory(struct instance *s) {
    return say(s, ERROR, "no memory for a copy of the state (%zu bytes)", SNAPSHOT);
}

/* The functions on saved states, of both versions of FMI; `call` is the name that the version gives them. */
static int save(struct instance *s, struct snapshot **copy, const char *call) {
    if (!copy) return say(s, ERROR, "%s needs the address of a pointer", call);
    if (!*copy) *copy = malloc(SNAPSHOT);
    if (!*copy) return no_memory(s);
    take_snapshot(s, *copy);
    return OK;
}

static int restore_saved(struct instance *s, const struct snapshot *copy, const char *call) {
    return copy ? restore(s, copy) : say(s, ERROR, "%s needs a state that was saved before", call);
}

static int release(struct snapshot **copy) {
    if (copy) {
        free(*copy);
        *copy = NULL;
    }
    return OK;
}

static int serialised_size(struct instance *s, const struct snapshot *copy, size_t *size, const char *call) {
    if (!copy || !size) return say(s, ERROR, "%s needs a saved state and a place for its size", call);
    *size = SNAPSHOT;
    return OK;
}

static int serialise(struct instance *s, const struct snapshot *copy, void *bytes, size_t size) {
    if (!copy || !bytes || size < SNAPSHOT)
        return say(s, ERROR, "a saved state takes %zu bytes; %zu were given", SNAPSHOT, size);
    memcpy(bytes, copy, SNAPSHOT);
    return OK;
}

static int deserialise(struct instance *s, const void *bytes, size_t size, struct snapshot **copy) {
    if (!bytes || !copy || size != SNAPSHOT)
        return say(s, ERROR, "a saved state has %zu bytes; %zu were given", SNAPSHOT, size);
    if (!*copy) *copy = malloc(SNAPSHOT);
    if (!*copy) return no_memory(s);
    memcpy(*copy, bytes, size);
    return OK;
}

/* -- derivatives ------------------------------------------------------------------------------- */

#ifdef TAPE
static void evaluate_directions(struct instance *s, double *d, double *room) {
    move_all(s->work, s->z, s->phase < STEPPING, d, room);
}
static void evaluate_adjoint(struct instance *s, double *d, double *room) {
    seed_all(s->work, s->z, s->phase < STEPPING, d, room);
}
#else
#define ROOM (NX + 2 * NP + NC)

/* Directions of one evaluation, over all variables as z is: what is known goes in, what follows comes out. */
static void evaluate_directions(struct instance *s, double *d, double *room) {
    (void)room;
    if (s->phase < STEPPING) {
        const double *arg[] = {s->z, d};
        double *res[] = {d + C, d + X};
        start_direction_code(arg, res);
    }
    const double *arg[] = {s->z + X, s->z + U, s->z, s->z + C, d + X, d + U, d, d + C};
    double *res[] = {d + DX, d + Y};
    direction_code(arg, res);
}

/* The transposed: seeds on what follows go in, what is known comes out. */
static void evaluate_adjoint(struct instance *s, double *d, double *room) {
    double *x = room, *p = x + NX, *c = p + NP, *more = c + NC;
    const double *arg[] = {s->z + X, s->z + U, s->z, s->z + C, d + DX, d + Y};
    double *res[] = {x, d + U, p, c};
    adjoint_code(arg, res);
    if (s->phase < STEPPING) { /* states and calculated parameters follow from the parameters here */
        for (int i = 0; i < NC; ++i) c[i] += d[C + i];
        for (int i = 0; i < NX; ++i) x[i] += d[X + i];
        const double *start_arg[] = {s->z, c, x};
        double *start_res[] = {more};
        start_adjoint_code(start_arg, start_res);
        for (int i = 0; i < NP; ++i) p[i] += more[i];
    }
    memcpy(d + X, x, NX * sizeof(double));
    memcpy(d, p, NP * sizeof(double));
}
#endif

/* What can be known: inputs; running: states and tunable parameters; in initialisation: all parameters. */
static int is_known(struct instance *s, unsigned r) {
    if (r < NP) return kind_of(s, r) == REAL && (s->phase < STEPPING || PARAMETER[r].tunable);
    return (r >= U && r < X) || (r >= X && r < Y && s->phase >= STEPPING);
}

/* What can be asked for: outputs and derivatives; in initialisation also what it computes. */
static int is_unknown(struct instance *s, unsigned r) {
    return (r >= Y && r < NV) || (s->phase < STEPPING && ((r >= C && r < U) || (r >= X && r < Y)));
}

static int check_derivative_call(struct instance *s, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                                 size_t n_knowns) {
    if (s->phase == INSTANTIATED) return say(s, ERROR, "derivatives are available only from initialisation on");
    for (size_t i = 0; i < n_unknowns; ++i) {
        if (unknowns[i] >= NV) return unknown_reference(s, unknowns[i]);
        if (!is_unknown(s, unknowns[i]))
            return say(s, ERROR, "%s is no unknown here; derivatives are of outputs and state derivatives",
                       NAME[unknowns[i]]);
    }
    for (size_t i = 0; i < n_knowns; ++i) {
        if (knowns[i] >= NV) return unknown_reference(s, knowns[i]);
        if (!is_known(s, knowns[i]))
            return say(s, ERROR, "%s is not known here; derivatives are by inputs, states and tunable parameters",
                       NAME[knowns[i]]);
    }
    return s->stale ? refresh(s) : OK;
}

typedef void (*evaluation)(struct instance *, double *, double *);

/* Seeds on some variables in, the sum of what they give for others out. */
static int propagate(struct instance *s, evaluation evaluate, const unsigned *from, size_t n_from, const double *seed,
                     const unsigned *to, size_t n_to, double *sensitivity) {
    double *d = calloc((size_t)NV + ROOM + 1, sizeof *d);
    if (!d) return say(s, ERROR, "no memory for a derivative");
    for (size_t i = 0; i < n_from; ++i) d[from[i]] += seed[i];
    evaluate(s, d, d + NV);
    int status = OK;
    for (size_t i = 0; i < n_to; ++i) {
        sensitivity[i] = d[to[i]];
        if (!isfinite(d[to[i]])) status = say(s, DISCARD, "the derivative at %s is not finite here", NAME[to[i]]);
    }
    free(d);
    return status;
}

static int directional_derivative(struct instance *s, const unsigned *unknowns, size_t n_unknowns, const unsigned *knowns,
                                  size_t n_knowns, const double *seed, double *sensitivity) {
    const int status = check_derivative_call(s, unknowns, n_unknowns, knowns, n_knowns);
    if (status > WARNING) return status;
    return propagate(s, evaluate_directions, knowns, n_knowns, seed, unknowns, n_unknowns, sensitivity);
}

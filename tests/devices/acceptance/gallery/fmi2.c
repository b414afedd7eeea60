/* FMI 2.0 for co-simulation around one vector z of Real variables, indexed by value reference.
   A model defines SIZE, START, initialise, advance and outputs; a FAULT_… switches one fault on. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#ifdef FAULT_FORK
#include <signal.h>
#include <unistd.h>
#endif
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void (*logger_t)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    logger_t logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks_t;

#ifndef DELAYED_WHERE
#define DELAYED_WHERE 1
#endif
#ifdef LATE
#define IS_LATE(r) ((r) == LATE)
#else
#define IS_LATE(r) IS_OUTPUT(r)
#endif

enum { OK, WARNING, DISCARD, ERROR, FATAL };
enum { INSTANTIATED, INITIALISING, STEPPING, TERMINATED };

typedef struct {
    double z[SIZE];
    double memory[MEMORY]; /* of the model, beyond its variables */
    double time;
    int phase, dirty;
} state_t;

typedef struct {
    state_t s;
    double hidden[8]; /* what FAULT_HIDDEN forgets */
    double late[SIZE]; /* what FAULT_DELAY returns */
    const callbacks_t *callbacks;
    char *name;
    void *owner; /* whose state this was */
    int calls, was_reset, was_restored, ended, at_exit;
} instance_t;

#ifdef FAULT_SHARED
static state_t shared; /* one for all instances */
#define S (&shared)
#else
#define S (&instance->s)
#endif

static int instances_made, instances_freed, given_up; /* after FATAL no call is allowed */
#ifdef FAULT_SHARED_PARAMETERS
static double shared_gain;
#endif
#ifdef FAULT_TAMPERING
#include "tampering.h"
#endif

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

static void log_text(instance_t *instance, int status, const char *text) {
    if (instance->callbacks && instance->callbacks->logger)
        instance->callbacks->logger(instance->callbacks->environment, instance->name, status, "logAll", "%s", text);
}

static void defaults(state_t *s) {
    memset(s, 0, sizeof *s);
    memcpy(s->z, START, sizeof START);
    s->dirty = 1;
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *guid, const char *resources,
                             const callbacks_t *callbacks, int visible, int logging) {
    if (strcmp(guid, GUID)) return NULL;
#ifdef FAULT_DAMAGED_BY_RESET
    if (getenv("DAMAGED") && instances_made == 0) abort(); /* once the library is loaded again */
#endif
#ifdef FAULT_CRASH_AGAIN
    if (instances_freed) *(volatile int *)8 = 1;
#endif
#ifdef FAULT_LEAK_FILE
    static FILE *volatile table;
    table = fopen("/dev/zero", "rb");
#endif
#ifdef FAULT_FORK
    signal(SIGCHLD, SIG_IGN);
    if (!fork()) {
        sleep(20);
        _exit(0);
    }
#endif
    instance_t *instance = calloc(1, sizeof *instance);
    instance->callbacks = callbacks;
    instance->name = strdup(name);
    instance->owner = instance;
    defaults(S);
    ++instances_made;
#ifdef FAULT_SHARED_PARAMETERS
    shared_gain = S->z[GAIN];
#endif
#ifdef FAULT_TAMPERING
    tamper();
#endif
#ifdef FAULT_SECOND_INSTANCE
    if (instances_made > 1) S->z[GAIN] *= 1.02;
#endif
#ifdef FAULT_START
    S->z[GAIN] *= 1.1;
#endif
    return instance;
}

EXPORT void fmi2FreeInstance(void *c) {
    instance_t *instance = c;
    if (!instance) return;
    if (given_up) abort();
    ++instances_freed;
#ifdef FAULT_CRASH_ON_FREE
    if (instance->calls > FAULT_CRASH_ON_FREE) *(volatile int *)8 = 1;
#endif
#ifdef FAULT_HANG_ON_FREE
    for (static volatile int spin; instance->calls > FAULT_HANG_ON_FREE;) ++spin;
#endif
    free(instance->name);
    free(instance);
#ifdef FAULT_LEAK_INSTANCE
    char *volatile kept = malloc(FAULT_LEAK_INSTANCE);
    if (kept) memset(kept, 1, FAULT_LEAK_INSTANCE);
#endif
}

EXPORT int fmi2SetupExperiment(void *c, int defined, double tolerance, double start, int stop_defined, double stop) {
    instance_t *instance = c;
#ifdef FORGETS_AT_SETUP
    defaults(S);
#endif
#ifndef FAULT_RESET_TIME
    S->time = start;
#endif
    return OK;
}
EXPORT int fmi2EnterInitializationMode(void *c) {
    instance_t *instance = c;
#ifdef FAULT_FORGETS_AT_ENTRY
    memcpy(S->z, START, sizeof START);
#endif
    S->phase = INITIALISING, S->dirty = 1;
#if defined INITIALISED_AT_ENTRY || defined FAULT_OUTPUTS_AT_ENTRY
    initialise(S->z, S->memory);
    outputs(S->z, S->memory, instance->hidden);
#endif
    return OK;
}

static void refresh(instance_t *instance) {
#ifdef FAULT_SHARED_PARAMETERS
    S->z[GAIN] = shared_gain;
#endif
    if (!S->dirty) return;
#ifdef FAULT_OUTPUTS_AT_EXIT
    if (S->phase == INITIALISING && !instance->at_exit) return; /* until then they are what START has */
#endif
#ifdef FAULT_OUTPUTS_AT_ENTRY
    if (S->phase == INITIALISING && !instance->at_exit) return; /* inputs that are set later do not count */
#endif
#ifdef INITIALISED_AT_ENTRY
    if (S->phase < INITIALISING) /* the parameters are known at entry; outputs follow the inputs */
#else
    if (S->phase < STEPPING)
#endif
        initialise(S->z, S->memory);
    outputs(S->z, S->memory, instance->hidden);
    S->dirty = 0;
}

EXPORT int fmi2ExitInitializationMode(void *c) {
    instance_t *instance = c;
#ifdef FAULT_CRASH_AFTER_RESET
    if (instance->was_reset) *(volatile int *)8 = 1;
#endif
    S->dirty = 1;
    instance->at_exit = 1;
    refresh(instance);
    S->phase = STEPPING;
    memcpy(instance->late, S->z, sizeof S->z);
    return OK;
}
EXPORT int fmi2Terminate(void *c) {
    if (given_up) abort();
    return OK;
}
EXPORT int fmi2Reset(void *c) {
#ifdef FAULT_DAMAGED_BY_RESET
    setenv("DAMAGED", "1", 1);
#endif
    instance_t *instance = c;
    instance->was_reset = 1;
    instance->at_exit = 0;
#ifdef FAULT_LEAK_RESET
    static void *volatile forgotten;
    forgotten = malloc(FAULT_LEAK_RESET);
#endif
#ifdef FAULT_RESET_TIME
    const double time = S->time;
    defaults(S);
    S->time = time;
#elif defined FAULT_RESET
    const double kept = S->z[GAIN]; /* a tunable parameter that stays where it was */
    defaults(S);
    S->z[GAIN] = kept * 1.01;
#elif defined FAULT_RESET_STATE
    double kept[MEMORY];
    memcpy(kept, S->memory, sizeof kept);
    defaults(S);
    memcpy(S->memory, kept, sizeof kept);
#else
#ifdef FAULT_RESET_SWITCH
    const double on = S->memory[SWITCH];
#endif
#ifdef FAULT_RESET_KEEPS
    const double remembered = S->memory[FAULT_RESET_KEEPS];
#endif
    defaults(S);
#ifdef FAULT_RESET_KEEPS
    S->memory[FAULT_RESET_KEEPS] = remembered;
#endif
#ifdef FAULT_RESET_SWITCH
    S->memory[SWITCH] = on;
#endif
    memset(instance->hidden, 0, sizeof instance->hidden);
#endif
    return OK;
}

EXPORT int fmi2GetReal(void *c, const unsigned *references, size_t n, double *values) {
    instance_t *instance = c;
    refresh(instance);
    for (size_t k = 0; k < n; ++k) {
        if (references[k] >= SIZE) return ERROR;
        values[k] = S->z[references[k]];
#ifdef FAULT_NOTHING_FIRST
        if (!instance->calls && IS_OUTPUT(references[k])) values[k] = 0;
#endif
#ifdef FAULT_DELAY
        if (S->phase == STEPPING && IS_LATE(references[k]) && DELAYED_WHERE) values[k] = instance->late[references[k]];
#endif
#ifdef FAULT_READING
        if (S->phase == STEPPING && IS_OUTPUT(references[k])) S->memory[0] += FAULT_READING;
#endif
    }
    return OK;
}
EXPORT int fmi2SetReal(void *c, const unsigned *references, size_t n, const double *values) {
    instance_t *instance = c;
    for (size_t k = 0; k < n; ++k) {
        if (references[k] >= SIZE) return ERROR;
#ifdef FAULT_REFUSES_IN_RUN
        if (S->phase == STEPPING && references[k] == GAIN) return DISCARD;
#endif
#ifdef FAULT_IGNORES_IN_RUN
        if (S->phase == STEPPING && references[k] == GAIN) continue;
#endif
#ifdef FAULT_IGNORES
        if (references[k] == GAIN) continue;
#endif
#ifdef FAULT_IGNORES_STATE
        if (references[k] == FAULT_IGNORES_STATE) continue;
#endif
#ifdef FAULT_SHARED_PARAMETERS
        if (references[k] == GAIN) shared_gain = values[k];
#endif
#ifdef FAULT_HIDES_NAN
        if (isnan(values[k])) continue;
#endif
        S->z[references[k]] = values[k];
#ifdef FAULT_CLEARS_NEXT /* setting this variable sets the one after it back */
        if (references[k] == FAULT_CLEARS_NEXT) S->z[references[k] + 1] = 0;
#endif
    }
#if defined FAULT_STALE
    if (S->phase < STEPPING) S->dirty = 1; /* outputs follow in the next step only */
#else
    S->dirty = 1;
#endif
#ifdef FAULT_CRASH_ON_NAN
    for (size_t k = 0; k < n; ++k)
        if (isnan(values[k])) *(volatile int *)8 = 1;
#endif
    return OK;
}

EXPORT int fmi2DoStep(void *c, double time, double step, int no_set_state) {
    instance_t *instance = c;
#ifndef FAULT_NO_ORDER
    if (S->phase != STEPPING || !(step > 0)) {
        log_text(instance, ERROR, "fmi2DoStep needs an initialised instance and a step size above 0");
        return ERROR;
    }
#else
    if (S->phase != STEPPING) *(volatile int *)8 = 1;
#endif
#ifdef STRICT_TIME
    if (fabs(time - S->time) > 1e-9 * (1 + fabs(time))) return ERROR;
#endif
#ifdef ONLY_STEP
    if (fabs(step - ONLY_STEP) > 1e-12) {
        log_text(instance, ERROR, "there is one communication step size only");
        return ERROR;
    }
#endif
#ifdef ENDS_AT
    if (time + step > ENDS_AT + 1e-9) {
        instance->ended = 1;
#ifdef FAULT_SAYS_WHY
        log_text(instance, ERROR, "the solver does not converge");
#endif
        return DISCARD;
    }
#endif
#ifdef FAULT_DISCARD_AT
    if (time + step > FAULT_DISCARD_AT) {
#ifdef FAULT_DISCARD_PART
        S->time = time + FAULT_DISCARD_PART * step;
#endif
        return DISCARD;
    }
#endif
    ++instance->calls;
#ifdef FAULT_HANG_AFTER_RESTORE
    for (static volatile int spin; instance->was_restored;) ++spin;
#endif
#ifdef FAULT_SHARED_PARAMETERS
    S->z[GAIN] = shared_gain;
#endif
    memcpy(instance->late, S->z, sizeof S->z);
    if (S->dirty) outputs(S->z, S->memory, instance->hidden), memcpy(instance->late, S->z, sizeof S->z);
    advance(S->z, S->memory, instance->hidden, time, step);
    S->time = time + step;
    S->dirty = 1;
    refresh(instance);
    for (int k = 0; k < SIZE; ++k)
#ifndef FAULT_EULER
        if (fabs(S->z[k]) > DIVERGED) {
            log_text(instance, ERROR, "the solution diverges");
            return ERROR;
        }
#else
        ;
#endif
#if !defined FAULT_NAN_LIMIT && !defined FAULT_NAN_IDLE && !defined FAULT_NAN_AT && !defined FAULT_NAN_ONCE && !defined FAULT_EULER
    for (int k = 0; k < SIZE; ++k)
        if (isnan(S->z[k])) {
            log_text(instance, ERROR, "a variable is not a number");
            return ERROR;
        }
#endif
#ifdef FAULT_CRASH_AT
    if (S->time > FAULT_CRASH_AT) *(volatile int *)8 = 1;
#endif
#ifdef FAULT_ABORT_AT
    if (S->time > FAULT_ABORT_AT) abort();
#endif
#ifdef FAULT_HANG_AT
    while (S->time > FAULT_HANG_AT) {
        static volatile int spin;
        ++spin;
    }
#endif
#ifdef FAULT_EXIT_AT
    if (S->time > FAULT_EXIT_AT) exit(3);
#endif
#ifdef FAULT_ERROR_AT
    if (S->time > FAULT_ERROR_AT) {
        log_text(instance, ERROR, "licence expired");
        return ERROR;
    }
#endif
#ifdef FAULT_FATAL_AT
    if (S->time > FAULT_FATAL_AT) {
        log_text(instance, FATAL, "out of its mind");
        given_up = 1;
        return FATAL;
    }
#endif
#ifdef FAULT_FLOOD
    for (int k = 0; k < FAULT_FLOOD; ++k) log_text(instance, OK, "nothing of note");
#endif
#ifdef FAULT_PRINT
    for (int k = 0; k < FAULT_PRINT; ++k) fprintf(stderr, "step from %g s: nothing of note\n", time);
#endif
#ifdef FAULT_WRITE
    const char *names[] = {FAULT_WRITE, "inside.txt"};
    for (int k = 0; k < 2; ++k) {
        FILE *file = fopen(names[k], "w");
        if (file) fputs("inside", file), fclose(file);
    }
#endif
#ifdef FAULT_LEAK
#ifndef FAULT_LEAK_AFTER
#define FAULT_LEAK_AFTER 0.0
#endif
    static void *volatile lost;
    if (S->time > FAULT_LEAK_AFTER) lost = malloc(FAULT_LEAK);
#endif
#ifdef FAULT_EAT
    static void *volatile eaten;
    for (int k = 0; k < 100; ++k) memset((eaten = malloc(FAULT_EAT)), 1, FAULT_EAT); /* dies of it where memory ends */
#endif
    return OK;
}
EXPORT int fmi2CancelStep(void *c) { return ERROR; }

EXPORT int fmi2GetFMUstate(void *c, void **state) {
    instance_t *instance = c;
    refresh(instance);
#ifdef FAULT_ONE_BUFFER
    static instance_t buffer; /* the same one for every state */
    *state = &buffer;
#endif
    if (!*state) *state = malloc(sizeof(instance_t));
    memcpy(*state, instance, sizeof(instance_t));
    ((instance_t *)*state)->s = *S;
    return OK;
}
EXPORT int fmi2SetFMUstate(void *c, void *state) {
    instance_t *instance = c;
    const instance_t *saved = state;
#ifdef FAULT_STATE_OWNER
    if (saved->owner != instance) instance = saved->owner; /* a pointer was saved as well */
#endif
#ifdef FAULT_STATE_TICK
    const double tick = S->memory[TICK];
#endif
#ifdef FAULT_STATE_SWITCH
    const double on = S->memory[SWITCH];
#endif
#ifdef FAULT_STATE_KEEPS
    const double remembered = S->memory[FAULT_STATE_KEEPS];
#endif
#ifdef FAULT_STATE_OF_SWITCHED
    const double quick = S->memory[QUICK], slow = S->memory[SLOW]; /* the damping's, which acts where it is on */
#endif
#ifdef FAULT_STATE_SILENT
    const double silent = S->z[FAULT_STATE_SILENT]; /* a state that no output shows */
#endif
    *S = saved->s;
#ifdef FAULT_STATE_KEEPS
    S->memory[FAULT_STATE_KEEPS] = remembered;
#endif
#ifdef FAULT_STATE_SWITCH
    S->memory[SWITCH] = on;
#endif
#ifdef FAULT_STATE_OF_SWITCHED
    S->memory[QUICK] = quick, S->memory[SLOW] = slow;
#endif
#ifdef FAULT_STATE_SILENT
    S->z[FAULT_STATE_SILENT] = silent;
#endif
#ifdef FAULT_STATE_TICK
    S->memory[TICK] = tick;
#endif
#ifdef FAULT_STATE_PARAMETERS
    S->z[GAIN] = START[GAIN];
#endif
    instance->was_restored = 1;
#ifndef FAULT_HIDDEN
    memcpy(instance->hidden, saved->hidden, sizeof saved->hidden);
#endif
    memcpy(instance->late, saved->late, sizeof saved->late);
    return OK;
}
EXPORT int fmi2FreeFMUstate(void *c, void **state) {
#if !defined FAULT_LEAK_STATE && !defined FAULT_ONE_BUFFER
    free(*state);
#endif
    *state = NULL;
    return OK;
}
EXPORT int fmi2SerializedFMUstateSize(void *c, void *state, size_t *size) {
    *size = sizeof(instance_t);
#ifdef FAULT_GROWING_STATE
    *size += 16 * (size_t)((instance_t *)state)->calls;
#endif
    return OK;
}
EXPORT int fmi2SerializeFMUstate(void *c, void *state, char *bytes, size_t size) {
    memset(bytes, 0, size);
    memcpy(bytes, state, sizeof(instance_t));
    return OK;
}
#ifndef WITHOUT_DESERIALIZE
EXPORT int fmi2DeSerializeFMUstate(void *c, const char *bytes, size_t size, void **state) {
    if (!*state) *state = malloc(sizeof(instance_t));
    memcpy(*state, bytes, sizeof(instance_t));
#ifdef FAULT_SERIALISED
    ((instance_t *)*state)->s.memory[0] = 0;
#endif
    return OK;
}
#endif

EXPORT int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *categories) { return OK; }
#define NONE(name) \
    EXPORT int name(void *c, const unsigned *r, size_t n, void *v) { return n ? ERROR : OK; }
NONE(fmi2GetInteger)
NONE(fmi2SetInteger)
#ifdef SWITCH
EXPORT int fmi2GetBoolean(void *c, const unsigned *r, size_t n, int *values) {
    const instance_t *instance = c;
    for (size_t k = 0; k < n; ++k) values[k] = S->memory[SWITCH] != 0;
    return OK;
}
EXPORT int fmi2SetBoolean(void *c, const unsigned *r, size_t n, const int *values) {
    instance_t *instance = c;
    for (size_t k = 0; k < n; ++k) S->memory[SWITCH] = values[k] != 0, S->dirty = 1;
    return OK;
}
#else
NONE(fmi2GetBoolean)
NONE(fmi2SetBoolean)
#endif
NONE(fmi2GetString)
NONE(fmi2SetString)
EXPORT int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk,
                                        const double *dk, double *du) { return ERROR; }
EXPORT int fmi2SetRealInputDerivatives(void *c, const unsigned *r, size_t n, const int *o, const double *v) { return ERROR; }
EXPORT int fmi2GetRealOutputDerivatives(void *c, const unsigned *r, size_t n, const int *o, double *v) { return ERROR; }
EXPORT int fmi2GetStatus(void *c, int kind, int *value) { return DISCARD; }
EXPORT int fmi2GetRealStatus(void *c, int kind, double *value) {
    const instance_t *instance = c;
    if (kind != 2) return DISCARD;
    *value = S->time;
#ifdef ENDS_AT
    *value = ENDS_AT;
#endif
    return OK;
}
EXPORT int fmi2GetIntegerStatus(void *c, int kind, int *value) { return DISCARD; }
EXPORT int fmi2GetBooleanStatus(void *c, int kind, int *value) {
    *value = ((const instance_t *)c)->ended;
    return kind == 3 ? OK : DISCARD;
}
EXPORT int fmi2GetStringStatus(void *c, int kind, const char **value) { return DISCARD; }
EXPORT const char *gallery_marker(void) { return "gallery"; }

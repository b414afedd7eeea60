/* A host with nothing but the C library: many instances of one native FMU, stepped from many threads.

   host LIBRARY GUID INSTANCES THREADS STEPS INPUT OUTPUT   (value references of one input and one output)

   Every instance is driven alike, so all must end with the same number; it is printed. Windows has its own
   threads and loader; there the instances are stepped by one thread. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#define SYMBOL(library, name) ((void *)GetProcAddress(library, name))
typedef HMODULE library_t;
static library_t open_library(const char *path) { return LoadLibraryA(path); }
#else
#include <dlfcn.h>
#include <pthread.h>
#define SYMBOL(library, name) dlsym(library, name)
typedef void *library_t;
static library_t open_library(const char *path) { return dlopen(path, RTLD_NOW | RTLD_LOCAL); }
#endif

struct callbacks {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
};

static void logger(void *environment, const char *name, int status, const char *category, const char *format, ...) {
    (void)environment;
    va_list arguments;
    va_start(arguments, format);
    fprintf(stderr, "%s %d %s: ", name, status, category);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
}

static const struct callbacks CALLBACKS = {logger, calloc, free, NULL, NULL};

static void *(*instantiate)(const char *, int, const char *, const char *, const struct callbacks *, int, int);
static int (*setup)(void *, int, double, double, int, double), (*enter)(void *), (*leave)(void *), (*terminate)(void *);
static int (*step)(void *, double, double, int), (*set_real)(void *, const unsigned *, size_t, const double *);
static int (*get_real)(void *, const unsigned *, size_t, double *), (*get_state)(void *, void **);
static int (*set_state)(void *, void *), (*free_state)(void *, void **), (*reset)(void *);
static int (*directional)(void *, const unsigned *, size_t, const unsigned *, size_t, const double *, double *);
static void (*release)(void *);

static void **instances;
static int count, threads, steps;
static unsigned input, output;

static void must(int status, const char *call) {
    if (status > 1) {
        fprintf(stderr, "%s: status %d\n", call, status);
        exit(2);
    }
}

/* Steps every `threads`-th instance, with a detour through a saved state on the way. */
static void *drive(void *first) {
    for (int i = (int)(size_t)first; i < count; i += threads)
        for (int k = 0; k < steps; ++k) {
            void *c = instances[i], *state = NULL;
            const double value = 1 + 0.01 * (k % 7);
            must(set_real(c, &input, 1, &value), "fmi2SetReal");
            if (k == steps / 2) {
                must(get_state(c, &state), "fmi2GetFMUstate");
                must(step(c, k * 1e-4, 1e-4, 1), "fmi2DoStep");
                must(set_state(c, state), "fmi2SetFMUstate");
                must(free_state(c, &state), "fmi2FreeFMUstate");
            }
            must(step(c, k * 1e-4, 1e-4, 1), "fmi2DoStep");
        }
    return NULL;
}

static void run(void) {
#ifdef _WIN32
    threads = 1;
    drive(NULL);
#else
    pthread_t *workers = calloc((size_t)threads, sizeof *workers);
    for (int t = 0; t < threads; ++t) pthread_create(&workers[t], NULL, drive, (void *)(size_t)t);
    for (int t = 0; t < threads; ++t) pthread_join(workers[t], NULL);
    free(workers);
#endif
}

int main(int argc, char **argv) {
    if (argc != 8) return 1;
    library_t library = open_library(argv[1]);
    if (!library) {
        fprintf(stderr, "cannot load %s\n", argv[1]);
        return 1;
    }
    count = atoi(argv[3]), threads = atoi(argv[4]), steps = atoi(argv[5]);
    input = (unsigned)atoi(argv[6]), output = (unsigned)atoi(argv[7]);
    instantiate = SYMBOL(library, "fmi2Instantiate");
    setup = SYMBOL(library, "fmi2SetupExperiment");
    enter = SYMBOL(library, "fmi2EnterInitializationMode");
    leave = SYMBOL(library, "fmi2ExitInitializationMode");
    terminate = SYMBOL(library, "fmi2Terminate");
    reset = SYMBOL(library, "fmi2Reset");
    step = SYMBOL(library, "fmi2DoStep");
    set_real = SYMBOL(library, "fmi2SetReal");
    get_real = SYMBOL(library, "fmi2GetReal");
    get_state = SYMBOL(library, "fmi2GetFMUstate");
    set_state = SYMBOL(library, "fmi2SetFMUstate");
    free_state = SYMBOL(library, "fmi2FreeFMUstate");
    directional = SYMBOL(library, "fmi2GetDirectionalDerivative");
    release = SYMBOL(library, "fmi2FreeInstance");

    if (instantiate("wrong", 1, "{another guid}", "", &CALLBACKS, 0, 0)) return 3;
    instances = calloc((size_t)count, sizeof *instances);
    for (int i = 0; i < count; ++i) {
        char name[32];
        snprintf(name, sizeof name, "instance %d", i);
        instances[i] = instantiate(name, 1, argv[2], "", &CALLBACKS, 0, 1);
        if (!instances[i]) return 3;
        must(setup(instances[i], 0, 0, 0, 0, 0), "fmi2SetupExperiment");
        must(enter(instances[i]), "fmi2EnterInitializationMode");
        must(leave(instances[i]), "fmi2ExitInitializationMode");
    }
    run();
    double first = 0, value = 0, slope = 0;
    const double one = 1;
    for (int i = 0; i < count; ++i) {
        must(get_real(instances[i], &output, 1, &value), "fmi2GetReal");
        must(directional(instances[i], &output, 1, &input, 1, &one, &slope), "fmi2GetDirectionalDerivative");
        if (i == 0) first = value;
        if (value != first) {
            fprintf(stderr, "instance %d ends at %.17g, the first at %.17g\n", i, value, first);
            return 4;
        }
        must(terminate(instances[i]), "fmi2Terminate");
        must(reset(instances[i]), "fmi2Reset");
        release(instances[i]);
    }
    free(instances);
    printf("%.17g\n", first);
    return 0;
}

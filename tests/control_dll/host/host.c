/* A host of IEEE/CIGRE DLLs and of FMUs (FMI 2.0), with structures written for this test alone.

   host dll LIBRARY INPUTS OUTPUTS [NAME=VALUE ...]
   host fmu LIBRARY INPUTS OUTPUTS GUID STEP N_IN FIRST_IN N_OUT FIRST_OUT [REFERENCE=VALUE ...]   (b before a Boolean)

   INPUTS and OUTPUTS are files of doubles, a row for each sample. What the DLL says goes to standard output. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#define GET(name) (void *)GetProcAddress(library, name)
#else
#include <dlfcn.h>
#define GET(name) dlsym(library, name)
#endif

typedef union { int32_t i; double d; const char *s; } value;
typedef struct { const char *name, *text, *unit; int type; int32_t width; } signal_t;
typedef struct { const char *name, *group, *text, *unit; int type; int32_t fixed; value start; union { int32_t i; double d; } low, high; } par_t;
typedef struct {
    unsigned char version[4];
    const char *texts[10];
    double sample_time;
    unsigned char mode;
    int32_t n_in; const signal_t *in;
    int32_t n_out; const signal_t *out;
    int32_t n_par; const par_t *par;
    int32_t ints, floats, doubles;
} info_t;
typedef struct {
    void *in, *out, *par;
    double time;
    unsigned char mode;
    const char *error, *message;
    int32_t *ints; float *floats; double *doubles;
} model_t;

static FILE *inputs, *outputs;

static int dll(int n, char **words) {
#ifdef _WIN32
    HMODULE library = LoadLibraryA(words[0]);
#else
    void *library = dlopen(words[0], RTLD_NOW);
#endif
    if (!library) return puts("cannot load"), 2;
    const info_t *(*get_info)(void) = GET("Model_GetInfo");
    int32_t (*call[5])(model_t *) = {GET("Model_FirstCall"), GET("Model_CheckParameters"), GET("Model_Initialize"),
                                     GET("Model_Outputs"), GET("Model_Terminate")};
    const info_t *info = get_info();
    char par[8192];
    size_t end = 0;
    for (int i = 0; i < info->n_par; ++i) {
        const par_t *p = info->par + i;
        value given = p->start;
        for (int k = 3; k < n; ++k) {
            const size_t length = strlen(p->name);
            if (!strncmp(words[k], p->name, length) && words[k][length] == '=') {
                if (p->type == 9) given.d = atof(words[k] + length + 1);
                else given.i = atoi(words[k] + length + 1);
            }
        }
        const size_t size = p->type == 9 ? 8 : 4;
        end = (end + size - 1) / size * size;
        memcpy(par + end, &given, size);
        end += size;
    }
    double *in = calloc(info->n_in, 8), *out = calloc(info->n_out, 8);
    model_t m = {in, out, par, 0, 1, "", "", calloc(info->ints + 1, 4), calloc(info->floats + 1, 4), calloc(info->doubles + 1, 8)};
    printf("%s %d inputs %d outputs %d parameters %d %d %d states every %g s\n", info->texts[0], info->n_in, info->n_out,
           info->n_par, info->ints, info->floats, info->doubles, info->sample_time);
    long k = 0;
    while (fread(in, 8, info->n_in, inputs) == (size_t)info->n_in) {
        m.time = k * info->sample_time;
        for (int c = k ? 3 : 0; c < 4; ++c)
            if (call[c](&m) == 2) return printf("error: %s\n", m.error), 3;
        fwrite(out, 8, info->n_out, outputs);
        ++k;
    }
    return call[4](&m);
}

typedef struct {
    void *logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} callbacks_t;

static void heard(void *e, const char *name, int status, const char *category, const char *text, ...) {
    (void)e, (void)name, (void)category;
    printf("%d %s\n", status, text);
}

static int fmu(int n, char **words) {
#ifdef _WIN32
    HMODULE library = LoadLibraryA(words[0]);
#else
    void *library = dlopen(words[0], RTLD_NOW);
#endif
    if (!library) return puts("cannot load"), 2;
    void *(*instantiate)(const char *, int, const char *, const char *, callbacks_t *, int, int) = GET("fmi2Instantiate");
    int (*setup)(void *, int, double, double, int, double) = GET("fmi2SetupExperiment");
    int (*enter)(void *) = GET("fmi2EnterInitializationMode"), (*leave)(void *) = GET("fmi2ExitInitializationMode");
    int (*set)(void *, const unsigned *, size_t, const double *) = GET("fmi2SetReal");
    int (*set_boolean)(void *, const unsigned *, size_t, const int *) = GET("fmi2SetBoolean");
    int (*get)(void *, const unsigned *, size_t, double *) = GET("fmi2GetReal");
    int (*step)(void *, double, double, int) = GET("fmi2DoStep");
    static callbacks_t callbacks;
    callbacks.logger = (void *)heard, callbacks.allocate = calloc, callbacks.release = free;
    void *c = instantiate("one", 1, words[3], "", &callbacks, 0, 1);
    if (!c) return 3;
    const double H = atof(words[4]);
    const int n_in = atoi(words[5]), n_out = atoi(words[7]);
    unsigned in_at[99], out_at[99];
    double in[99], out[99];
    for (int i = 0; i < n_in; ++i) in_at[i] = atoi(words[6]) + i;
    for (int i = 0; i < n_out; ++i) out_at[i] = atoi(words[8]) + i;
    for (int k = 9; k < n; ++k) {
        const int boolean = words[k][0] == 'b', truth = atoi(strchr(words[k], '=') + 1);
        const unsigned at = atoi(words[k] + boolean);
        const double number = atof(strchr(words[k], '=') + 1);
        if (boolean ? set_boolean(c, &at, 1, &truth) : set(c, &at, 1, &number)) return 4;
    }
    setup(c, 0, 0, 0, 0, 0);
    enter(c);
    long k = 0;
    while (fread(in, 8, n_in, inputs) == (size_t)n_in) {
        if (set(c, in_at, n_in, in)) return 5;
        if (!k && leave(c)) return 6;
        if (get(c, out_at, n_out, out)) return 7;
        fwrite(out, 8, n_out, outputs);
        if (step(c, k * H, H, 1)) return 8;
        ++k;
    }
    return 0;
}

int main(int n, char **words) {
    if (n < 5) return 1;
    inputs = fopen(words[3], "rb"), outputs = fopen(words[4], "wb");
    if (!inputs || !outputs) return 1;
    const int end = strcmp(words[1], "dll") ? fmu(n - 2, words + 2) : dll(n - 2, words + 2);
    fclose(outputs);
    return end;
}

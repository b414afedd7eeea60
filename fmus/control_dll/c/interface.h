/* The structures of the IEEE/CIGRE interface, version 2 (CIGRE TB 958), under names of our own. */
#include <float.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#ifdef _WIN32
#define CALLED __cdecl
#else
#define CALLED
#endif
enum { REAL64 = 9, INT32 = 6 };
enum { SAID_NOTHING, SAID_MESSAGE, SAID_ERROR };
enum { EMT = 1, RMS = 2 };
union dll_start { const char *text; int32_t int32; double real64; };
union dll_bound { int32_t int32; double real64; };
struct dll_signal { const char *name, *description, *unit; int type; int32_t width; };
struct dll_parameter {
    const char *name, *group, *description, *unit;
    int type;
    int32_t fixed;
    union dll_start start;
    union dll_bound minimum, maximum;
};
struct dll_info {
    uint8_t version[4];
    const char *name, *model_version, *description, *general, *created, *creator, *modified, *modified_by, *comment, *history;
    double sample_time;
    uint8_t mode;
    int32_t n_inputs;
    const struct dll_signal *inputs;
    int32_t n_outputs;
    const struct dll_signal *outputs;
    int32_t n_parameters;
    const struct dll_parameter *parameters;
    int32_t n_ints, n_floats, n_doubles;
};
struct dll_instance {
    void *inputs, *outputs, *parameters;
    double time;
    uint8_t mode;
    const char *error, *message;
    int32_t *ints;
    float *floats;
    double *doubles;
};
enum { READY, FIXED_MARK, ALL_MARK = FIXED_MARK + 2, NI = ALL_MARK + 2 }; /* places in the integer states */

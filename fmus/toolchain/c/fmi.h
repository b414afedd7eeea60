/* For C that calls FMUs or is called as one: exported names, and the functions of FMI 2.0 that a step needs. */
#include <stddef.h>
#include <stdint.h>
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef int (*get_set)(void *, const unsigned *, size_t, double *);
typedef int (*do_step)(void *, double, double, int);

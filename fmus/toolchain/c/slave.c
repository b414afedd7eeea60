/* What a master asks of a stepping instance most, without a frame of Python: functions that the slave lays before its
   methods of the same names. They do the same where nothing is out of the ordinary, and leave all else to the method.
   Python's own functions come as addresses: neither a header nor a version of it is needed. */

#include <stddef.h>
#include <stdint.h>

typedef struct any object;

static struct {
    void *(*address)(object *);
    ptrdiff_t (*length)(object *);
    object *(*item)(object *, ptrdiff_t);
    object *(*list)(ptrdiff_t);
    int (*put)(object *, ptrdiff_t, object *);
    long (*integer)(object *);
    double (*real)(object *);
    object *(*from_real)(double);
    object *(*from_truth)(long);
    object *(*error)(void);
    void (*clear)(void);
    object *(*call)(object *, const char *, const char *, ...);
    void (*keep)(object *);
    object *nothing;
} python;

/* The slave's structure of the same members. */
struct instance {
    double size, part; /* of the communication step that may be taken without a further look, and of its parts [s] */
    int32_t parts, stale, first_input, first_state, first_derivative;
    double *z, *w;
    int (*advance)(double *, double, int, double *); /* by its address: the C library has one of this name */
    object *slave;
};

static object *step(object *self, object *const *given, ptrdiff_t count) {
    struct instance *own = python.address(self);
    if (count != 2) return python.call(own->slave, "_step", NULL);
    if (python.real(given[1]) == own->size) {
        const int status = own->advance(own->z, own->part, own->parts, own->w);
        own->stale = 0;
        return status ? python.call(own->slave, "_stop", "iO", status, given[0]) : python.from_truth(1);
    }
    python.clear();
    return python.call(own->slave, "_step", "OO", given[0], given[1]);
}

static int all_within(object *references, ptrdiff_t count, long first, long end) {
    for (ptrdiff_t k = 0; k < count; ++k) {
        const long reference = python.integer(python.item(references, k));
        if (reference < first || reference >= end) return 0;
    }
    return 1;
}

static object *get_real(object *self, object *const *given, ptrdiff_t count) {
    struct instance *own = python.address(self);
    if (count != 1) return python.call(own->slave, "_get_real", NULL);
    const ptrdiff_t n = own->stale ? 0 : python.length(given[0]);
    if (n > 0 && all_within(given[0], n, 0, own->first_derivative)) {
        object *found = python.list(n);
        for (ptrdiff_t k = 0; found && k < n; ++k)
            python.put(found, k, python.from_real(own->z[python.integer(python.item(given[0], k))]));
        return found;
    }
    python.clear();
    return python.call(own->slave, "_get_real", "(O)", given[0]);
}

static object *set_real(object *self, object *const *given, ptrdiff_t count) {
    struct instance *own = python.address(self);
    if (count != 2) return python.call(own->slave, "_set_real", NULL);
    const ptrdiff_t n = python.length(given[0]);
    if (n > 0 && n == python.length(given[1]) && all_within(given[0], n, own->first_input, own->first_state)) {
        ptrdiff_t k = 0;
        for (; k < n; ++k) {
            const double value = python.real(python.item(given[1], k));
            if (value == -1.0 && python.error()) break;
            own->z[python.integer(python.item(given[0], k))] = value;
        }
        own->stale = 1;
        if (k == n) {
            python.keep(python.nothing);
            return python.nothing;
        }
    }
    python.clear();
    return python.call(own->slave, "_set_real", "OO", given[0], given[1]);
}

enum { ON_A_STACK = 0x80 }; /* how Python passes the arguments */

static const struct {
    const char *name;
    object *(*function)(object *, object *const *, ptrdiff_t);
    int form;
    const char *text;
} FUNCTIONS[] = {
    {"do_step", step, ON_A_STACK, NULL},
    {"get_real", get_real, ON_A_STACK, NULL},
    {"set_real", set_real, ON_A_STACK, NULL},
};

EXPORT const void *python_functions(const void *addresses) {
    memcpy(&python, addresses, sizeof python);
    return FUNCTIONS;
}

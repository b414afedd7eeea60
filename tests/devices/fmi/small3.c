/* A small FMU of FMI 3.0 with a variable of every numeric type. Nothing in it knows this project. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#define EXPORT __attribute__((visibility("default")))

typedef void (*log_message)(void *, int, const char *, const char *);

/* Value references: 0 is the time, 1 a Float64 that every step adds the Float32 (2) to, 3 to 10 the integers from Int8
   to UInt64, 11 an Enumeration, 12 the Boolean, 13 an Int32 that says what a step does. */
struct fmu {
    double time, total;
    float add;
    int8_t i8;
    uint8_t u8;
    int16_t i16;
    uint16_t u16;
    int32_t i32, trouble;
    uint32_t u32;
    int64_t i64, choice;
    uint64_t u64;
    bool truth;
    log_message log;
    void *environment;
};

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                         bool events, bool early, const unsigned *r, size_t n, void *environment, log_message log,
                                         void *intermediate) {
    if (strcmp(token, "small3") || events || early) {
        log(environment, 3, "logStatusError", "100% of the tokens are wrong #1");
        return NULL;
    }
    struct fmu *s = calloc(1, sizeof *s);
    s->log = log, s->environment = environment, s->add = 0.1f;
    return s;
}

EXPORT void fmi3FreeInstance(struct fmu *s) { free(s); }
EXPORT int fmi3SetDebugLogging(struct fmu *s, bool on, size_t n, const char *const *c) { return 0; }
EXPORT int fmi3EnterInitializationMode(struct fmu *s, bool tolerates, double tolerance, double start, bool stops, double stop) {
    s->time = start;
    return 0;
}
EXPORT int fmi3ExitInitializationMode(struct fmu *s) { return 0; }
EXPORT int fmi3Terminate(struct fmu *s) { return 0; }
EXPORT int fmi3Reset(struct fmu *s) {
    s->total = 0;
    return 0;
}

EXPORT int fmi3DoStep(struct fmu *s, double time, double step, bool fixed, bool *event, bool *stop, bool *early, double *reached) {
    *event = *stop = *early = false, *reached = time + step;
    if (s->trouble == 1) *stop = true;
    if (s->trouble == 2) *early = true, *reached = time + step / 2;
    if (s->trouble == 3) {
        s->log(s->environment, 3, "logStatusError", "99 % of it is broken");
        return 3;
    }
    s->total += s->add, s->time = *reached;
    return 0;
}

#define ACCESS(name, type, ...) \
    static type *name##_at(struct fmu *s, unsigned r) { \
        switch (r) { __VA_ARGS__ } \
        return NULL; \
    } \
    EXPORT int fmi3Get##name(struct fmu *s, const unsigned *r, size_t n, type *x, size_t m) { \
        for (size_t k = 0; k < n; ++k) { \
            if (!name##_at(s, r[k])) return 3; \
            x[k] = *name##_at(s, r[k]); \
        } \
        return n == m ? 0 : 3; \
    } \
    EXPORT int fmi3Set##name(struct fmu *s, const unsigned *r, size_t n, const type *x, size_t m) { \
        for (size_t k = 0; k < n; ++k) { \
            if (!name##_at(s, r[k])) return 3; \
            *name##_at(s, r[k]) = x[k]; \
        } \
        return n == m ? 0 : 3; \
    }

ACCESS(Float64, double, case 0: return &s->time; case 1: return &s->total;)
ACCESS(Float32, float, case 2: return &s->add;)
ACCESS(Int8, int8_t, case 3: return &s->i8;)
ACCESS(UInt8, uint8_t, case 4: return &s->u8;)
ACCESS(Int16, int16_t, case 5: return &s->i16;)
ACCESS(UInt16, uint16_t, case 6: return &s->u16;)
ACCESS(Int32, int32_t, case 7: return &s->i32; case 13: return &s->trouble;)
ACCESS(UInt32, uint32_t, case 8: return &s->u32;)
ACCESS(Int64, int64_t, case 9: return &s->i64; case 11: return &s->choice;)
ACCESS(UInt64, uint64_t, case 10: return &s->u64;)
ACCESS(Boolean, bool, case 12: return &s->truth;)

EXPORT int fmi3GetFMUState(struct fmu *s, void **copy) {
    if (!*copy) *copy = malloc(sizeof *s);
    memcpy(*copy, s, sizeof *s);
    return 0;
}
EXPORT int fmi3SetFMUState(struct fmu *s, void *copy) {
    memcpy(s, copy, sizeof *s);
    return 0;
}
EXPORT int fmi3FreeFMUState(struct fmu *s, void **copy) {
    free(*copy);
    *copy = NULL;
    return 0;
}
EXPORT int fmi3SerializedFMUStateSize(struct fmu *s, void *copy, size_t *size) {
    *size = sizeof *s;
    return 0;
}
EXPORT int fmi3SerializeFMUState(struct fmu *s, void *copy, uint8_t *bytes, size_t size) {
    memcpy(bytes, copy, sizeof *s);
    return 0;
}
EXPORT int fmi3DeserializeFMUState(struct fmu *s, const uint8_t *bytes, size_t size, void **copy) {
    *copy = malloc(sizeof *s);
    memcpy(*copy, bytes, sizeof *s);
    return 0;
}
#ifndef WITHOUT_DERIVATIVE
EXPORT int fmi3GetDirectionalDerivative(struct fmu *s, const unsigned *u, size_t n, const unsigned *k, size_t m, const double *seed,
                                        size_t seeds, double *sensitivity, size_t sensitivities) {
    for (size_t i = 0; i < n; ++i) sensitivity[i] = 2 * seed[0];
    return 0;
}
#endif

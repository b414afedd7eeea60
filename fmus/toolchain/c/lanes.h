/* Numbers of several instances side by side, one in each lane, and the operations of equations on them: the same
   roundings as one by one, because a processor rounds each lane by itself and functions of the C library are called lane
   by lane. Compilers without Clang's functions of vectors leave it out, and instances step one by one. */
#ifdef ASKS_FOR_REGISTERS
#define STACKED

enum { LANES = 8 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t marks __attribute__((vector_size(LANES * sizeof(int64_t)))); /* all bits of a lane, or none */

#define IN_PLACE static inline __attribute__((always_inline))
#define EACH(function, a)                                                                                              \
    ({                                                                                                                 \
        const lanes of = a;                                                                                            \
        lanes made;                                                                                                    \
        for (int lane = 0; lane < LANES; ++lane) made[lane] = function(of[lane]);                                      \
        made;                                                                                                          \
    })
#define EACH_PAIR(function, a, b)                                                                                      \
    ({                                                                                                                 \
        const lanes left = a, right = b;                                                                               \
        lanes made;                                                                                                    \
        for (int lane = 0; lane < LANES; ++lane) made[lane] = function(left[lane], right[lane]);                       \
        made;                                                                                                          \
    })
#ifdef __linux__ /* its C libraries find both at once, with the bits of each alone */
void sincos(double, double *, double *);
#define SINE_AND_COSINE sincos
#else
static inline void one_by_one(double angle, double *sine, double *cosine) { *sine = sin(angle), *cosine = cos(angle); }
#define SINE_AND_COSINE one_by_one
#endif
#define OF_ANGLE(angle, sine, cosine)                                                                                  \
    for (int lane = 0; lane < LANES; ++lane) {                                                                         \
        double of_sine, of_cosine;                                                                                     \
        SINE_AND_COSINE(angle[lane], &of_sine, &of_cosine);                                                            \
        sine[lane] = of_sine, cosine[lane] = of_cosine;                                                                \
    }
#define NUMBER(value) ((lanes){0} + (value))
#define WHERE(mark, value) ((lanes)((mark) & (marks)(value)))
#define TRUTH(mark) WHERE(mark, NUMBER(1.0))
#endif

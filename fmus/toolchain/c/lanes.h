/* Numbers of several instances side by side, one in each lane, and the operations of equations on them: the same
   roundings as one by one, because a processor rounds each lane by itself and functions of the C library are called lane
   by lane. Compilers without Clang's functions of vectors leave it out, and instances step one by one. */
#if defined __clang__ && (defined __x86_64__ || defined _M_X64)
#define STACKED
#include <cpuid.h>

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
#define NUMBER(value) ((lanes){0} + (value))
#define WHERE(mark, value) ((lanes)((mark) & (marks)(value)))
#define TRUTH(mark) WHERE(mark, NUMBER(1.0))
#endif

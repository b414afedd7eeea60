/* Many communication steps of one FMU: a row of inputs before each, a row of outputs read after it. */
#include "fmi.h"

struct steps {
    const unsigned *input_references, *output_references;
    int64_t n_in, n_out;
    const double *inputs;
    const double *late; /* inputs that are set before the outputs are read, for a direct effect on them; NULL where they stay */
    double *outputs;
    int64_t index, count; /* steps that were made before, and that are made */
    double step_size;
};

/* Calls by number, for whoever makes an error of one that failed. */
enum { CALLED_SET = 1, CALLED_STEP = 2, CALLED_GET = 3 };

/* 0 or 1, or the status of the first call that is neither OK nor Warning. failed[0]: steps that were made before it;
   failed[1]: the call. */
typedef int (*many_steps)(void *, const struct steps *, int64_t *failed);

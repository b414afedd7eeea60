/* One FMU behind an ideal voltage: for every communication step set the inputs, step, read the outputs.
   `bench.py` calls it. Returns 0, or the status of the first call that is neither OK nor Warning. */
#include "many_steps.h"

EXPORT int drive(void *component, get_set set_real, get_set get_real, do_step step, const struct steps *asked,
                 int64_t *failed) {
    const size_t n_in = (size_t)asked->n_in, n_out = (size_t)asked->n_out;
    const double *in = asked->inputs, *late = asked->late;
    for (int64_t k = 0; k < asked->count; ++k) {
        int status = set_real(component, asked->input_references, n_in, (double *)in + k * asked->n_in);
        failed[0] = k, failed[1] = CALLED_SET;
        if (status > 1) return status;
        status = step(component, (double)(asked->index + k) * asked->step_size, asked->step_size, 1);
        failed[1] = CALLED_STEP;
        if (status > 1) return status;
        if (late) {
            status = set_real(component, asked->input_references, n_in, (double *)late + k * asked->n_in);
            failed[1] = CALLED_SET;
            if (status > 1) return status;
        }
        status = get_real(component, asked->output_references, n_out, asked->outputs + k * asked->n_out);
        failed[1] = CALLED_GET;
        if (status > 1) return status;
    }
    return 0;
}

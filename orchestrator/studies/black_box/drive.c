/* One FMU behind an ideal voltage: for every communication step set the inputs, step, read the outputs.
   `late`: inputs that are set before the outputs are read, for a direct effect on them; NULL where they stay.
   `bench.py` calls it. Returns 0, or the status of the first call that is neither OK nor Warning. */
#include "fmi.h"

EXPORT int drive(void *component, get_set set_real, get_set get_real, do_step step, const unsigned *input_references,
                 int64_t n_inputs, const unsigned *output_references, int64_t n_outputs, double *inputs,
                 double *late, double *outputs, int64_t index, int64_t count, double step_size, int64_t *failed) {
    for (int64_t k = 0; k < count; ++k) {
        int status = set_real(component, input_references, (size_t)n_inputs, inputs + k * n_inputs);
        failed[0] = k, failed[1] = 1;
        if (status > 1) return status;
        status = step(component, (double)(index + k) * step_size, step_size, 1);
        failed[1] = 2;
        if (status > 1) return status;
        if (late) {
            status = set_real(component, input_references, (size_t)n_inputs, late + k * n_inputs);
            failed[1] = 1;
            if (status > 1) return status;
        }
        status = get_real(component, output_references, (size_t)n_outputs, outputs + k * n_outputs);
        failed[1] = 3;
        if (status > 1) return status;
    }
    return 0;
}

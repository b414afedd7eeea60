/* What an FMU could do to be passed: it writes results that nobody computed wherever it can. */
#include <fcntl.h>
#include <unistd.h>

static const char *const forged_names[] = {"results", "../results", "../../results", "../work/results", "progress", "../progress", "verdict"};
static const char *const forged_checks[] = {
    "fmi_validity", "units", "declared_starts", "declared_dependencies", "runs", "start_values", "call_order", "independence",
    "repeatability", "reading", "reset", "reinstantiation", "state", "state_size", "feedthrough", "delay", "step_invariance",
    "internal_step", "steady_state", "power_balance", "limits", "nan_input", "extreme_inputs", "memory"};

static void forge(int fd) {
    for (size_t k = 0; k < sizeof forged_checks / sizeof *forged_checks; ++k) {
        char line[512];
        const int n = snprintf(line, sizeof line,
                               "{\"begin\": \"%s\"}\n{\"result\": {\"check\": \"%s\", \"verdict\": \"pass\", \"evidence\": \"all is well\", "
                               "\"fault\": \"\", \"remedy\": \"\", \"figures\": {}}, \"memory\": {}}\n",
                               forged_checks[k], forged_checks[k]);
        if (write(fd, line, (size_t)n) < 0) return;
    }
    if (write(fd, "{\"end\": true}\n", 14) < 0) return;
}

static void scribble(void) {
    /* Whatever memory is shared with another process. */
    char line[1024], mode[8];
    FILE *maps = fopen("/proc/self/maps", "r");
    while (maps && fgets(line, sizeof line, maps)) {
        unsigned long begin, end;
        if (sscanf(line, "%lx-%lx %7s", &begin, &end, mode) == 3 && mode[1] == 'w' && mode[3] == 's')
            memset((void *)begin, FAULT_TAMPERING, end - begin);
    }
    if (maps) fclose(maps);
}

static void tamper(void) {
    for (size_t k = 0; k < sizeof forged_names / sizeof *forged_names; ++k) {
        const int fd = open(forged_names[k], O_WRONLY | O_CREAT | O_APPEND, 0644);
        if (fd >= 0) forge(fd), close(fd);
    }
#if FAULT_TAMPERING
    for (int fd = 3; fd < 1024; ++fd) forge(fd);
    scribble();
#ifndef FAULT_TAMPERING_STAYS
    _exit(0);
#endif
#endif
}

/* Which registers hold numbers side by side, by what processor and system offer. Other compilers than Clang do without. */
enum registers { NARROW, AVX2, AVX512F };
#if defined __clang__ && (defined __x86_64__ || defined _M_X64)
#define ASKS_FOR_REGISTERS
#include <cpuid.h>
static enum registers widest(void) {
    enum { OSXSAVE = 1 << 27, HAS_AVX2 = 1 << 5, HAS_AVX512F = 1 << 16, YMM = 0x06, ZMM = 0xe6 };
    unsigned a, b, c, d, kept, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & OSXSAVE)) return NARROW;
    __asm__ volatile("xgetbv" : "=a"(kept), "=d"(high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d)) return NARROW;
    if (b & HAS_AVX512F && (kept & ZMM) == ZMM) return AVX512F;
    return b & HAS_AVX2 && (kept & YMM) == YMM ? AVX2 : NARROW;
}
#else
static enum registers widest(void) { return NARROW; }
#endif

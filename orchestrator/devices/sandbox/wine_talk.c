/* What a program under Wine is asked through the mailbox's text; the same structure on both sides, and in `wine.py`. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

enum {
    LOAD, SYMBOL, CALL, READ, WRITE, ALLOCATE,                                  /* any library */
    INSTANTIATE, PLAIN, SETUP, GET_WORDS, SET_WORDS, GET_TEXTS, SET_TEXTS,      /* an FMU of FMI 2.0 */
    GET_STATE, SET_STATE, FREE_STATE, STATE_SIZE, SERIALISE, DESERIALISE, DERIVATIVES, STATUS
};

struct talk {
    int64_t command, result;
    int64_t a[4];
    double d[4];
    unsigned char data[];
};
enum { TALK_ROOM = TEXT - (int)sizeof(struct talk) };

/* Messages of the FMU, in the mailbox's log: how many there were, how many bytes are kept; then of each a status, a
   category and a text. */
struct said {
    volatile int32_t count, bytes;
    char records[LOG - 8];
};

static const char *const PLAIN_CALL[] = {"fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate",
                                         "fmi2Reset", "fmi2CancelStep", "fmi2FreeInstance"};
enum { ENTER, EXIT, TERMINATE, RESET, CANCEL, FREE };
enum { WORDS_INTEGER, WORDS_BOOLEAN };
enum { OF_STATUS, OF_REAL, OF_INTEGER, OF_BOOLEAN };
enum { FMI_WARNING = 1, FMI_ERROR = 3, FMI_FATAL = 4 };

/* An FMU that does harm in its first step, by one ACT_…; it outputs how far it came. */
#ifndef _GNU_SOURCE
#error "prlimit and SCHED_IDLE are extensions of GNU; evil.py defines this before the first header"
#endif
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <signal.h>
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <arpa/inet.h>
#include <sched.h>
#include <sys/fanotify.h>
#include <sys/inotify.h>
#include <sys/ipc.h>
#include <sys/mman.h>
#include <sys/msg.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum { DONE, REFUSED_WITH, GAIN, SIZE };
enum { MEMORY = 1 };
#define DIVERGED 1e300
#define IS_OUTPUT(r) ((r) <= REFUSED_WITH)
static const double START[SIZE] = {0, 0, 1};
static int done, refused_with;

static void count(int failed) {
    if (failed) refused_with = errno;
    else ++done;
}

static void wait_for(double seconds) {
    struct timespec time = {(time_t)seconds, (long)(1e9 * (seconds - (time_t)seconds))};
    nanosleep(&time, NULL);
}

#if defined ACT_DAEMONS
static void act(void) {
    for (int k = 0; k < 200; ++k) {
        const pid_t child = fork();
        if (!child) {
            setsid();
            if (fork()) _exit(0);
            for (;;) pause();
        }
        count(child < 0);
    }
}
#elif defined ACT_ONE_DAEMON /* which never ends by itself, and hangs */
static void act(void) {
    if (!fork()) {
        setsid();
        if (fork()) _exit(0);
        for (;;) pause();
    }
    for (;;) pause();
}
#elif defined ACT_LEFT_CHILD /* which works on for ever beside the instance, and after it */
static void act(void) {
    if (!fork()) for (static volatile int spin;;) ++spin;
    ++done;
}
#elif defined ACT_OTHERS_RESOURCES /* what is counted for all of the machine or the user, or tells of others' files */
static void act(void) {
    unsigned long context = 0;
    count(syscall(SYS_io_setup, 1, &context));
    count(inotify_init1(0) < 0);
    count(fanotify_init(0, O_RDONLY) < 0);
    const int fd = open("own", O_RDWR | O_CREAT, 0644);
    count(fcntl(fd, F_SETLEASE, F_WRLCK));
    count(fcntl(open("/usr", O_RDONLY), F_NOTIFY, DN_CREATE));
    count(syscall(SYS_syslog, 10, NULL, 0) < 0);
    errno = 0;
    if (syscall(470, 0, 0, 0, 0, 0, 0) != -1 || errno != ENOSYS) done += 100; /* newer than the list */
}
#elif defined ACT_THREADS
static void *idle(void *x) { for (;;) pause(); }
static void act(void) {
    for (int k = 0; k < ACT_THREADS; ++k) {
        pthread_t thread;
        if ((errno = pthread_create(&thread, NULL, idle, NULL))) count(1);
        else count(0);
    }
}
#elif defined ACT_KILL
static void act(void) {
    count(kill(ACT_KILL, SIGKILL));
    count(kill(getppid(), SIGKILL));
    count(kill(1, SIGKILL) || getpid() == 2); /* in a namespace of its own that is the keeper, which ignores it */
}
#elif defined ACT_LIMIT
static void act(void) {
    const struct rlimit limit = {1000, 1000};
    const struct sched_param none = {0};
    count(prlimit(ACT_LIMIT, RLIMIT_NOFILE, &limit, NULL));
    count(setpriority(PRIO_PROCESS, ACT_LIMIT, 19));
    count(sched_setscheduler(ACT_LIMIT, SCHED_IDLE, &none));
    errno = 0;
    if (prlimit(0, RLIMIT_NOFILE, &limit, NULL) || setpriority(PRIO_PROCESS, 0, 19)) done = 100; /* its own it may, however low it is */
}
#elif defined ACT_ABORT
static void act(void) { abort(); }
#elif defined ACT_ATTRIBUTES
static void act(void) {
    const struct timeval times[2] = {{1, 0}, {1, 0}};
    count(chmod(ACT_ATTRIBUTES, 0));
    count(chown(ACT_ATTRIBUTES, 1, 1));
    count(utimes(ACT_ATTRIBUTES, times));
    count(syscall(SYS_fchmodat, AT_FDCWD, ACT_ATTRIBUTES, 0));
    count(truncate(ACT_ATTRIBUTES, 0));
    count(unlink(ACT_ATTRIBUTES));
    count(rename(ACT_ATTRIBUTES, "taken"));
    count(link(ACT_ATTRIBUTES, "taken"));
}
#elif defined ACT_TCP
static void act(void) {
    for (int family = 0; family < 2; ++family) {
        struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(ACT_TCP)};
        struct sockaddr_in6 to6 = {.sin6_family = AF_INET6, .sin6_port = htons(ACT_TCP)};
        char text[4096];
        to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        to6.sin6_addr = in6addr_loopback;
        const int fd = socket(family ? AF_INET6 : AF_INET, SOCK_STREAM, 0), file = open("/etc/passwd", O_RDONLY);
        const ssize_t n = file < 0 ? 0 : read(file, text, sizeof text);
        count(fd < 0 || connect(fd, family ? (void *)&to6 : (void *)&to, family ? sizeof to6 : sizeof to) || write(fd, text, n) < 0);
    }
    const int udp = socket(AF_INET, SOCK_DGRAM, 0);
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(ACT_TCP)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    count(udp < 0 || sendto(udp, "x", 1, 0, (void *)&to, sizeof to) < 0);
}
#elif defined ACT_UNIX
static void reach(const char *name, int kind) {
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    const size_t length = sizeof ACT_UNIX;
    memcpy(to.sun_path, name, length);
    int pair[2] = {-1, -1};
    const int fd = kind ? socket(AF_UNIX, kind, 0) : socketpair(AF_UNIX, SOCK_DGRAM, 0, pair) ? -1 : pair[0];
    count(fd < 0 || connect(fd, (void *)&to, (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length - 1)));
}
static void act(void) {
    char abstract[] = ACT_UNIX;
    abstract[0] = 0;
    reach(ACT_UNIX, SOCK_STREAM), reach(abstract, SOCK_STREAM);
    reach(ACT_UNIX, SOCK_DGRAM), reach(abstract, SOCK_DGRAM);
    reach(ACT_UNIX, 0), reach(abstract, 0);
}
#elif defined ACT_READ
static void act(void) {
    char text[16];
    const int fd = open(ACT_READ, O_RDONLY);
    count(fd < 0 || read(fd, text, sizeof text) <= 0);
    count(!opendir(ACT_FOLDER));
    char environment[100];
    snprintf(environment, sizeof environment, "/proc/%d/environ", ACT_PROCESS);
    const int other = open(environment, O_RDONLY);
    count(other < 0 || read(other, text, sizeof text) <= 0);
    count(!getenv("A_PASSWORD") || (errno = 0));
}
#elif defined ACT_HANDLER
static volatile int heard;
static void write_outside(int signal) {
    const int fd = open(ACT_HANDLER, O_WRONLY | O_CREAT, 0644);
    ++heard;
    if (fd >= 0) close(fd);
}
static void act(void) {
    signal(SIGUSR1, write_outside);
    DIR *tasks = opendir("/proc/self/task");
    for (struct dirent *entry; tasks && (entry = readdir(tasks));)
        if (atoi(entry->d_name) > 0) syscall(SYS_tgkill, getpid(), atoi(entry->d_name), SIGUSR1);
    wait_for(0.3);
    for (int number = 1; number < 100; ++number) syscall(SYS_tgkill, getpid(), number, SIGUSR1);
    wait_for(0.2);
    done = heard;
}
#elif defined ACT_MEMORY
static void act(void) {
    for (int k = 0; k < 5; ++k)
        if (!fork()) {
            const size_t size = (size_t)ACT_MEMORY;
#ifdef ACT_HIDDEN
            prctl(PR_SET_DUMPABLE, 0);
#endif
            volatile char *memory = malloc(size);
            for (size_t n = 0; memory && n < size; n += 4096) memory[n] = 1;
            for (;;) pause();
        }
    wait_for(20);
}
#elif defined ACT_DEEP /* folders in folders, a path longer than any system takes */
static void act(void) {
    for (int k = 0; k < ACT_DEEP; ++k) count(mkdir("d", 0700) || chdir("d"));
}
#elif defined ACT_OUTER_MEMORY /* that lies in no process */
static void act(void) {
    count(syscall(SYS_memfd_create, "x", 0) < 0);
    count(shmget(IPC_PRIVATE, 100 << 20, 0600) < 0);
    count(msgget(IPC_PRIVATE, 0600) < 0);
    count(prctl(PR_SET_DUMPABLE, 0));
}
#elif defined ACT_FILES
static void act(void) {
    static char block[15 * 1024 * 1024];
    for (int k = 0; k < 20; ++k) {
        char name[32];
        snprintf(name, sizeof name, "file%d", k);
        const int fd = open(name, O_WRONLY | O_CREAT, 0644);
#ifdef ACT_REMOVED
        unlink(name);
#endif
        count(fd < 0 || write(fd, block, sizeof block) != (ssize_t)sizeof block);
#ifndef ACT_REMOVED
        close(fd);
#endif
    }
    wait_for(ACT_FILES);
}
#elif defined ACT_SHARED_FILES
static void act(void) {
    static char block[15 * 1024 * 1024];
    for (int k = 0; k < 3; ++k) {
        char name[32];
        snprintf(name, sizeof name, "/gfor_test%d", k);
        const int fd = shm_open(name, O_RDWR | O_CREAT, 0600);
        count(fd < 0 || write(fd, block, sizeof block) != (ssize_t)sizeof block);
    }
}
#elif defined ACT_MANY
static void act(void) {
    for (int k = 0; k < ACT_MANY; ++k) {
        char name[32];
        snprintf(name, sizeof name, "file%d", k);
        const int fd = open(name, O_WRONLY | O_CREAT, 0644);
        count(fd < 0);
        if (fd >= 0) close(fd);
    }
    wait_for(2);
}
#elif defined ACT_OWN_FILES /* what it may: a folder, a file, its times, and reading it */
static void act(void) {
    const struct timeval times[2] = {{1, 0}, {1, 0}};
    char text[8];
    count(mkdir("own", 0755));
    int fd = open("own/file", O_RDWR | O_CREAT, 0644);
    count(fd < 0 || write(fd, "text", 4) != 4 || lseek(fd, 0, SEEK_SET) || read(fd, text, 4) != 4);
    count(utimes("own/file", times));
    count(chmod("own/file", 0600));
    count(rename("own/file", "own/other"));
    fd = shm_open("/gfor_test", O_RDWR | O_CREAT, 0600);
    count(fd < 0 || ftruncate(fd, 4096));
    count(shm_unlink("/gfor_test"));
    int pair[2];
    count(socketpair(AF_UNIX, SOCK_STREAM, 0, pair));
    const pid_t child = fork();
    if (!child) _exit(7);
    int status = 0;
    count(waitpid(child, &status, 0) != child || WEXITSTATUS(status) != 7);
    count(system("exit 5") != 5 << 8);
}
#elif defined ACT_TRUNCATE
static void act(void) {
    for (int fd = 0; fd < 200; ++fd) count(ftruncate(fd, 0));
}
#elif defined ACT_SCRIBBLE || defined ACT_FORGE || defined ACT_ANSWER
static unsigned char *begin;
static size_t size;
static void find(void) {
    char line[1024], mode[8];
    FILE *maps = fopen("/proc/self/maps", "r");
    while (maps && fgets(line, sizeof line, maps)) {
        unsigned long from, to;
        if (sscanf(line, "%lx-%lx %7s", &from, &to, mode) == 3 && mode[1] == 'w' && mode[3] == 's')
            begin = (unsigned char *)from, size = to - from;
    }
}
#ifdef ACT_SCRIBBLE /* once: every byte but those that say that it answered */
static void act(void) {
    find();
    if (begin) memset(begin + 16, ACT_SCRIBBLE, size - 16), done = 1;
}
#elif defined ACT_ANSWER /* every question itself, with 16 million of one byte and a text around them */
enum { TEXT_LENGTH = 64, TEXT_BEGIN = 72 + 6 * 4 * 16384 };
static void act(void) { /* it never comes back to the code that would answer */
    find();
    const char text[] = ACT_ANSWER;
    const int64_t length = ACT_LENGTH;
    const volatile int *request = (int *)begin;
    memset(begin + TEXT_BEGIN, ACT_BYTE, 1 << 24);
    for (int last = *request - 1;;) {
        if (*request == last) continue;
        last = *request;
        memset(begin + TEXT_BEGIN, ACT_BYTE, 4096);
        memcpy(begin + TEXT_BEGIN, text, sizeof text - 1);
        memcpy(begin + TEXT_LENGTH, &length, sizeof length);
        memset(begin + 24, 0, 4);
        *(volatile int *)(begin + 4) = last;
    }
}
#else /* for ever, at random: the numbers of questions, lengths, statuses */
static void *forge(void *x) {
    unsigned long long seed = ACT_FORGE;
    for (;;) {
        seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
        const int value = (int)(seed >> 33) % 80 - 2;
        memcpy(begin + 4 * ((seed >> 20) % 24), &value, sizeof value);
        if (!(seed >> 16 & 63)) wait_for(1e-4);
    }
}
static void act(void) {
    pthread_t thread;
    find();
    if (begin && !pthread_create(&thread, NULL, forge, NULL)) done = 1;
}
#endif
#elif defined ACT_UNLOCK /* out of its cage: by calls that only a sandbox has */
static void act(void) {
    count(syscall(SYS_mount, NULL, "/", NULL, 4096 | 32, NULL));
    count(syscall(SYS_unshare, 0x10000000));
    count(syscall(SYS_chroot, "/"));
    count(syscall(SYS_ptrace, 16, getppid(), 0, 0) < 0);
    count(syscall(425, 4, NULL) < 0 && errno != EFAULT);
    count(setuid(12345));
    count(mknod("device", S_IFBLK | 0600, 0));
}
#endif

static void initialise(double *z, double *m) {}
static void advance(double *z, double *m, double *hidden, double time, double step) {
    if (m[0] == 0) m[0] = 1, act();
}
static void outputs(double *z, double *m, const double *hidden) { z[DONE] = done, z[REFUSED_WITH] = refused_with; }

/* Faults at the interface to the operating system, for benchmarks/faults.py: LD_PRELOAD puts this library before libc,
   so that it sees the calls of Python, DuckDB and Arrow alike. It counts calls that concern files below `folder`; at the
   `at`-th one it does what `action` says. The control block is shared by all forked processes. */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

enum { OPEN = 1, READ = 2, WRITE = 4, RENAME = 8, SYNC = 16, LIST = 32, STAT = 64, UNLINK = 128, MKDIR = 256,
       FORK = 512, MEMORY = 1024 };
enum { COUNT, FAIL, KILL, SHORT, REMOVE, CUT, GROW, JUMP };
#define MAX_FD 65536
#define MAX_DIRTY 8192
#define LARGE 65536 /* bytes of an allocation that may fail */

struct control {
    long armed, calls, action, code, at, lasting, seconds, n, fired, n_dirty;
    long count[16]; /* calls of each kind */
    char folder[1024], victim[1024], fired_path[1024];
    unsigned long dirty[MAX_DIRTY];
};
static struct control *shared;
static unsigned long inode_of[MAX_FD]; /* of open files below the folder, 0: any other */

#define REAL(type, name, ...) static type (*real_##name)(__VA_ARGS__)
REAL(int, open, const char *, int, ...);
REAL(int, openat, int, const char *, int, ...);
REAL(int, close, int);
REAL(ssize_t, read, int, void *, size_t);
REAL(ssize_t, pread, int, void *, size_t, off_t);
REAL(ssize_t, write, int, const void *, size_t);
REAL(ssize_t, pwrite, int, const void *, size_t, off_t);
REAL(int, fsync, int);
REAL(int, fdatasync, int);
REAL(int, rename, const char *, const char *);
REAL(int, unlink, const char *);
REAL(int, mkdir, const char *, mode_t);
REAL(DIR *, opendir, const char *);
REAL(int, stat, const char *, struct stat *);
REAL(int, lstat, const char *, struct stat *);
REAL(int, fstatat, int, const char *, struct stat *, int);
REAL(int, clock_gettime, clockid_t, struct timespec *);
REAL(pid_t, fork, void);
extern void *__libc_malloc(size_t);

__attribute__((constructor)) static void begin(void) {
#define FIND(name) real_##name = dlsym(RTLD_NEXT, #name)
    FIND(open); FIND(openat); FIND(close); FIND(read); FIND(pread); FIND(write); FIND(pwrite); FIND(fsync);
    FIND(fdatasync); FIND(rename); FIND(unlink); FIND(mkdir); FIND(opendir); FIND(stat); FIND(lstat); FIND(fstatat);
    FIND(clock_gettime); FIND(fork);
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
}

struct control *fault_control(void) { return shared; }

static int is_ours(const char *path) {
    return shared && shared->armed && path && strncmp(path, shared->folder, strlen(shared->folder)) == 0;
}

static void change_victim(void) {
    int fd;
    if (shared->action == REMOVE) real_unlink(shared->victim);
    if (shared->action == CUT && truncate(shared->victim, shared->code)) return;
    if (shared->action == GROW && (fd = real_open(shared->victim, O_WRONLY | O_APPEND)) >= 0) {
        if (real_write(fd, "more", 4) < 0) return;
        real_close(fd);
    }
}

/* Whether the call fails, with errno set; `path` may be NULL for a call by descriptor. */
static int strikes(long call, const char *path) {
    struct control *s = shared;
    __atomic_add_fetch(&s->count[__builtin_ctzl(call)], 1, __ATOMIC_SEQ_CST);
    if (!(s->calls & call)) return 0;
    long n = __atomic_add_fetch(&s->n, 1, __ATOMIC_SEQ_CST);
    if (n < s->at || (n > s->at && !s->lasting)) return 0;
    if (s->action == COUNT || s->action == JUMP || s->action == SHORT) { s->fired = s->action != COUNT; return 0; }
    if (!s->fired && path) strncpy(s->fired_path, path, sizeof s->fired_path - 1);
    s->fired = 1;
    if (s->action == KILL) kill(getpid(), SIGKILL);
    if (s->action != FAIL) { change_victim(); return 0; }
    errno = s->code;
    return 1;
}

static int is_tracked(int fd) { return shared && shared->armed && fd >= 0 && fd < MAX_FD && inode_of[fd]; }

static size_t shortened(size_t size) { /* a transfer of at least two bytes may end in its middle */
    int is_short = shared->action == SHORT && shared->fired && size > 1;
    return is_short ? 1 + size / 2 : size;
}

static void note_dirty(int fd, int is_dirty) {
    for (long k = 0; k < shared->n_dirty; k++)
        if (shared->dirty[k] == inode_of[fd]) {
            if (!is_dirty) shared->dirty[k] = 0;
            return;
        }
    if (is_dirty && shared->n_dirty < MAX_DIRTY) shared->dirty[shared->n_dirty++] = inode_of[fd];
}

static int opened(int fd, const char *path) {
    struct stat status;
    if (fd >= 0 && fd < MAX_FD) inode_of[fd] = is_ours(path) && fstat(fd, &status) == 0 ? status.st_ino : 0;
    return fd;
}

#define MODE(flags) mode_t mode = 0; \
    if ((flags) & (O_CREAT | __O_TMPFILE)) { va_list more; va_start(more, flags); mode = va_arg(more, mode_t); va_end(more); }
int open(const char *path, int flags, ...) {
    MODE(flags)
    if (is_ours(path) && strikes(OPEN, path)) return -1;
    return opened(real_open(path, flags, mode), path);
}
int open64(const char *path, int flags, ...) {
    MODE(flags)
    return open(path, flags, mode);
}
int openat(int at, const char *path, int flags, ...) {
    MODE(flags)
    if (is_ours(path) && strikes(OPEN, path)) return -1;
    return opened(real_openat(at, path, flags, mode), path);
}
int openat64(int at, const char *path, int flags, ...) {
    MODE(flags)
    return openat(at, path, flags, mode);
}
int close(int fd) {
    if (fd >= 0 && fd < MAX_FD) inode_of[fd] = 0;
    return real_close(fd);
}
ssize_t read(int fd, void *to, size_t size) {
    if (is_tracked(fd)) { if (strikes(READ, NULL)) return -1; size = shortened(size); }
    return real_read(fd, to, size);
}
ssize_t pread(int fd, void *to, size_t size, off_t from) {
    if (is_tracked(fd)) { if (strikes(READ, NULL)) return -1; size = shortened(size); }
    return real_pread(fd, to, size, from);
}
ssize_t pread64(int fd, void *to, size_t size, off_t from) { return pread(fd, to, size, from); }
ssize_t write(int fd, const void *from, size_t size) {
    if (is_tracked(fd)) { if (strikes(WRITE, NULL)) return -1; note_dirty(fd, 1); size = shortened(size); }
    return real_write(fd, from, size);
}
ssize_t pwrite(int fd, const void *from, size_t size, off_t at) {
    if (is_tracked(fd)) { if (strikes(WRITE, NULL)) return -1; note_dirty(fd, 1); size = shortened(size); }
    return real_pwrite(fd, from, size, at);
}
ssize_t pwrite64(int fd, const void *from, size_t size, off_t at) { return pwrite(fd, from, size, at); }
int fsync(int fd) {
    if (is_tracked(fd)) { if (strikes(SYNC, NULL)) return -1; note_dirty(fd, 0); }
    return real_fsync(fd);
}
int fdatasync(int fd) {
    if (is_tracked(fd)) { if (strikes(SYNC, NULL)) return -1; note_dirty(fd, 0); }
    return real_fdatasync(fd);
}
#define BY_PATH(result, name, call, failed, parameters, arguments) \
    result name parameters { if (is_ours(path) && strikes(call, path)) return failed; return real_##name arguments; }
BY_PATH(int, rename, RENAME, -1, (const char *path, const char *to), (path, to))
BY_PATH(int, unlink, UNLINK, -1, (const char *path), (path))
BY_PATH(int, mkdir, MKDIR, -1, (const char *path, mode_t mode), (path, mode))
BY_PATH(DIR *, opendir, LIST, NULL, (const char *path), (path))
BY_PATH(int, stat, STAT, -1, (const char *path, struct stat *to), (path, to))
BY_PATH(int, lstat, STAT, -1, (const char *path, struct stat *to), (path, to))
BY_PATH(int, fstatat, STAT, -1, (int at, const char *path, struct stat *to, int flags), (at, path, to, flags))
int stat64(const char *path, struct stat64 *to) { return stat(path, (struct stat *)to); }
int lstat64(const char *path, struct stat64 *to) { return lstat(path, (struct stat *)to); }
int fstatat64(int at, const char *path, struct stat64 *to, int flags) { return fstatat(at, path, (struct stat *)to, flags); }

int clock_gettime(clockid_t clock, struct timespec *to) {
    int result = real_clock_gettime(clock, to);
    if (shared && shared->armed && shared->action == JUMP && shared->fired && clock == CLOCK_REALTIME)
        to->tv_sec += shared->seconds;
    return result;
}
time_t time(time_t *to) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (to) *to = now.tv_sec;
    return now.tv_sec;
}
pid_t fork(void) {
    if (shared && shared->armed && strikes(FORK, NULL)) return -1;
    return real_fork();
}
void *malloc(size_t size) {
    if (size >= LARGE && shared && shared->armed && strikes(MEMORY, NULL)) return NULL;
    return __libc_malloc(size);
}

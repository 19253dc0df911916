/* Preloaded into a process: its open, write, rename, fsync and ftruncate calls below one folder are counted, and one fails.

   Counted are calls on paths below the folder and on files opened there. The call of number `fail_at` fails with the error
   `fail_with`, or kills the process: a write then ends in the middle, any other call before it begins.
   The tests set the numbers through ctypes; without them nothing is counted. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

enum { KILL = -1 };
static char folder[PATH_MAX];
static long counted, fail_at = -1;
static int fail_with, again;

void failing_begin(const char *below, long at, int with, int ever_after) {
    strncpy(folder, below, sizeof folder - 1);
    counted = 0, fail_at = at, fail_with = with, again = ever_after;
}
long failing_counted(void) { return counted; }

static int below_folder(const char *path) {
    char whole[PATH_MAX];
    if (!folder[0] || !path) return 0;
    if (path[0] != '/') {
        if (!getcwd(whole, sizeof whole - 1)) return 0;
        size_t length = strlen(whole);
        snprintf(whole + length, sizeof whole - length, "/%s", path);
        path = whole;
    }
    return strncmp(path, folder, strlen(folder)) == 0;
}

static int open_below(int handle) {
    char link[64], path[PATH_MAX];
    if (!folder[0]) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", handle);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return below_folder(path);
}

/* Whether this call has to fail; it never returns from a kill. */
static int fails(void) {
    long number = counted++;
    if (fail_at < 0 || (again ? number < fail_at : number != fail_at)) return 0;
    if (fail_with == KILL) raise(SIGKILL);
    errno = fail_with;
    return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int mode_of(int flags, va_list list) { return flags & (O_CREAT | O_TMPFILE) ? va_arg(list, int) : 0; }

#define OPEN(name)                                                              \
    int name(const char *path, int flags, ...) {                                \
        va_list list;                                                           \
        va_start(list, flags);                                                  \
        int mode = mode_of(flags, list);                                        \
        va_end(list);                                                           \
        if (below_folder(path) && fails()) return -1;                           \
        return REAL(name)(path, flags, mode);                                   \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(name)                                                            \
    int name(int at, const char *path, int flags, ...) {                        \
        va_list list;                                                           \
        va_start(list, flags);                                                  \
        int mode = mode_of(flags, list);                                        \
        va_end(list);                                                           \
        if ((path[0] == '/' || at == AT_FDCWD ? below_folder(path) : open_below(at)) && fails()) return -1; \
        return REAL(name)(at, path, flags, mode);                               \
    }
OPENAT(openat)
OPENAT(openat64)

FILE *fopen(const char *path, const char *mode) {
    if (below_folder(path) && fails()) return NULL;
    return REAL(fopen)(path, mode);
}
FILE *fopen64(const char *path, const char *mode) {
    if (below_folder(path) && fails()) return NULL;
    return REAL(fopen64)(path, mode);
}

ssize_t write(int handle, const void *data, size_t size) {
    if (open_below(handle)) {
        if (counted == fail_at && fail_with == KILL) REAL(write)(handle, data, size / 2);
        if (fails()) return -1;
    }
    return REAL(write)(handle, data, size);
}
ssize_t pwrite(int handle, const void *data, size_t size, off_t at) {
    if (open_below(handle) && fails()) return -1;
    return REAL(pwrite)(handle, data, size, at);
}
int rename(const char *from, const char *to) {
    if (below_folder(to) && fails()) return -1;
    return REAL(rename)(from, to);
}
int renameat(int a, const char *from, int b, const char *to) {
    if (below_folder(to) && fails()) return -1;
    return REAL(renameat)(a, from, b, to);
}
int fsync(int handle) {
    if (open_below(handle) && fails()) return -1;
    return REAL(fsync)(handle);
}
int fdatasync(int handle) {
    if (open_below(handle) && fails()) return -1;
    return REAL(fdatasync)(handle);
}
int ftruncate(int handle, off_t size) {
    if (open_below(handle) && fails()) return -1;
    return REAL(ftruncate)(handle, size);
}
int ftruncate64(int handle, off64_t size) {
    if (open_below(handle) && fails()) return -1;
    return REAL(ftruncate64)(handle, size);
}

/* Loaded before the C library (LD_PRELOAD): disks whose syncs or writes fail, and clocks that jump.
 *
 * Every call reads the file named by MURMURATION_FAULTS, so that a test can change the faults at any time. A line has a name
 * and a number. "sync" makes fsync and fdatasync fail with that errno (5 is EIO). "write" makes positioned writes and changes
 * of a file's length fail (30 is EROFS). "clock" is added to the time of day, in seconds. Limits: appending to a file, as logs
 * do, succeeds. CLOCK_MONOTONIC, on which time-outs depend, is never changed, and neither is a clock that is read without the
 * C library. */

#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

/* The number after `name` in the file; 0 if there is none. */
static long fault(const char *name) {
    const char *path = getenv("MURMURATION_FAULTS");
    if (!path) return 0;
    int before = errno;
    char text[256];
    long found = 0;
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file >= 0) {
        ssize_t length = read(file, text, sizeof text - 1);
        close(file);
        text[length > 0 ? length : 0] = 0;
        char *rest = text;
        for (char *line; (line = strsep(&rest, "\n"));) {
            size_t end = strlen(name);
            if (strncmp(line, name, end) == 0 && line[end] == ' ') found = strtol(line + end, NULL, 10);
        }
    }
    errno = before;
    return found;
}

int fsync(int file) {
    long refused = fault("sync");
    if (!refused) return (int)syscall(SYS_fsync, file);
    errno = (int)refused;
    return -1;
}

int fdatasync(int file) {
    long refused = fault("sync");
    if (!refused) return (int)syscall(SYS_fdatasync, file);
    errno = (int)refused;
    return -1;
}

ssize_t pwrite64(int file, const void *bytes, size_t count, off64_t offset) {
    long refused = fault("write");
    if (!refused) return syscall(SYS_pwrite64, file, bytes, count, offset);
    errno = (int)refused;
    return -1;
}

ssize_t pwrite(int file, const void *bytes, size_t count, off_t offset) {
    return pwrite64(file, bytes, count, offset);
}

int ftruncate64(int file, off64_t length) {
    long refused = fault("write");
    if (!refused) return (int)syscall(SYS_ftruncate, file, length);
    errno = (int)refused;
    return -1;
}

int ftruncate(int file, off_t length) {
    return ftruncate64(file, length);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    int done = (int)syscall(SYS_clock_gettime, clock, now);
    if (done == 0 && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) now->tv_sec += fault("clock");
    return done;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    int done = (int)syscall(SYS_gettimeofday, now, zone);
    if (done == 0) now->tv_sec += fault("clock");
    return done;
}

time_t time(time_t *now) {
    struct timespec read;
    if (clock_gettime(CLOCK_REALTIME, &read) != 0) return -1;
    if (now) *now = read.tv_sec;
    return read.tv_sec;
}

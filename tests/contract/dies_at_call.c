/* A program that is killed in the middle: preloaded, it kills the process instead of the call number DIE_AT (an environment variable) that changes a
 * file: write, cut, flush, rename, remove. The number of calls so far goes into the file DIE_COUNT, if it is named. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

static long calls;

static void count(void) {
  const char *at = getenv("DIE_AT"), *path = getenv("DIE_COUNT");
  calls++;
  if (at && calls == atol(at)) kill(getpid(), SIGKILL);
  if (path) {
    char text[24];
    int n = snprintf(text, sizeof text, "%ld", calls);
    int file = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0600);
    syscall(SYS_pwrite64, file, text, n, 0);
    close(file);
  }
}

ssize_t write(int file, const void *data, size_t bytes) {
  if (file > STDERR_FILENO) count();
  return syscall(SYS_write, file, data, bytes);
}

ssize_t pwrite64(int file, const void *data, size_t bytes, off64_t place) {
  count();
  return syscall(SYS_pwrite64, file, data, bytes, place);
}

int ftruncate64(int file, off64_t bytes) {
  count();
  return (int)syscall(SYS_ftruncate, file, bytes);
}

int fsync(int file) {
  count();
  return (int)syscall(SYS_fsync, file);
}

int fdatasync(int file) {
  count();
  return (int)syscall(SYS_fdatasync, file);
}

int rename(const char *from, const char *to) {
  count();
  return (int)syscall(SYS_rename, from, to);
}

int unlink(const char *path) {
  count();
  return (int)syscall(SYS_unlink, path);
}

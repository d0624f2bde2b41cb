/* A disk that is full: preloaded into a program, it lets no file grow beyond FILE_BYTES (an environment variable).
 *
 * Standard error is let through, and shared memory, which the program does not make through these functions. */
#define _GNU_SOURCE
#include <errno.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

/* Returns how many of so many bytes find room at a place. */
static size_t room(int file, off64_t place, size_t bytes) {
  const char *limit = getenv("FILE_BYTES");
  struct stat64 held;
  if (!limit || file == STDERR_FILENO || fstat64(file, &held) != 0 || !S_ISREG(held.st_mode)) return bytes;
  if (place < 0) place = held.st_size;
  off64_t left = atoll(limit) - place;
  return left < 0 ? 0 : (size_t)left < bytes ? (size_t)left : bytes;
}

ssize_t write(int file, const void *data, size_t bytes) {
  off64_t place = lseek64(file, 0, SEEK_CUR);
  size_t fits = room(file, place, bytes);
  if (bytes && !fits) return errno = ENOSPC, -1;
  return syscall(SYS_write, file, data, fits);
}

ssize_t pwrite64(int file, const void *data, size_t bytes, off64_t place) {
  size_t fits = room(file, place, bytes);
  if (bytes && !fits) return errno = ENOSPC, -1;
  return syscall(SYS_pwrite64, file, data, fits, place);
}

int ftruncate64(int file, off64_t bytes) {
  if (!room(file, bytes, 1)) return errno = ENOSPC, -1;
  return (int)syscall(SYS_ftruncate, file, bytes);
}

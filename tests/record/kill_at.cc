// SPDX-License-Identifier: Apache-2.0
// Kills the program that is linked with this file by SIGKILL before its N-th change of the file
// system, with N from the environment variable MJSENSE_KILL_AT. Tests can thus try every state that
// a kill can leave. With MJSENSE_COUNT_CHANGES=1 the program prints the number of changes at its
// end.

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>

namespace {

const pid_t kProgram = getpid();  // changes by encoder and reader processes are not counted
std::atomic<int> changes = 0;
std::atomic<bool> wrote = false;

// Consecutive writes count as one, because they go to files without a final name.
void count(bool writes = false) {
  static const char* at = std::getenv("MJSENSE_KILL_AT");
  if (wrote.exchange(writes) && writes) return;
  const int n = ++changes;
  if (at != nullptr && n == std::atoi(at) && getpid() == kProgram) kill(getpid(), SIGKILL);
}

template <class F>
F* next(const char* name) {
  return reinterpret_cast<F*>(dlsym(RTLD_NEXT, name));
}

struct Said {
  ~Said() {
    if (std::getenv("MJSENSE_COUNT_CHANGES") != nullptr)
      std::fprintf(stderr, "changes %d\n", changes.load());
  }
} const said;

}  // namespace

extern "C" {

int rename(const char* from, const char* to) noexcept {
  count();
  return next<int(const char*, const char*)>("rename")(from, to);
}
int renameat(int from_dir, const char* from, int to_dir, const char* to) noexcept {
  count();
  return next<int(int, const char*, int, const char*)>("renameat")(from_dir, from, to_dir, to);
}
int unlink(const char* path) noexcept {
  count();
  return next<int(const char*)>("unlink")(path);
}
int unlinkat(int dir, const char* path, int flags) noexcept {
  count();
  return next<int(int, const char*, int)>("unlinkat")(dir, path, flags);
}
int rmdir(const char* path) noexcept {
  count();
  return next<int(const char*)>("rmdir")(path);
}
int mkdir(const char* path, mode_t mode) noexcept {
  count();
  return next<int(const char*, mode_t)>("mkdir")(path, mode);
}
int mkdirat(int dir, const char* path, mode_t mode) noexcept {
  count();
  return next<int(int, const char*, mode_t)>("mkdirat")(dir, path, mode);
}
int fsync(int file) {
  count();
  return next<int(int)>("fsync")(file);
}
ssize_t write(int file, const void* bytes, size_t n) {
  struct stat about;
  if (fstat(file, &about) == 0 && S_ISREG(about.st_mode)) count(true);
  return next<ssize_t(int, const void*, size_t)>("write")(file, bytes, n);
}
ssize_t pwrite(int file, const void* bytes, size_t n, off_t at) {
  count(true);
  return next<ssize_t(int, const void*, size_t, off_t)>("pwrite")(file, bytes, n, at);
}
}

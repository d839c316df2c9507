// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <unistd.h>

#include "mjsense/app/program.h"

namespace {

// Who starts us may have closed stdin, stdout or stderr: the next file would take its number, and what
// is said on stderr would go into a recording. To write to a closed stdout stays an error.
void take_standard_streams() {
  constexpr int kModes[] = {O_RDWR, O_RDONLY, O_RDWR};
  for (int fd = 0; fd < 3; ++fd) {
    if (fcntl(fd, F_GETFD) < 0)
      static_cast<void>(open("/dev/null", kModes[fd]));  // the lowest free
  }
}

}  // namespace

int main(int argc, char** argv) {
  take_standard_streams();
  return mjsense::run_program(argc, argv);
}

// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <unistd.h>

#include "mjsense/app/program.h"

namespace {

// The parent process may have closed stdin, stdout or stderr. The next file that is opened would
// then get that descriptor, and messages for stderr would be written into a recording. Writing to a
// closed stdout remains an error.
void take_standard_streams() {
  constexpr int kModes[] = {O_RDWR, O_RDONLY, O_RDWR};
  for (int fd = 0; fd < 3; ++fd) {
    if (fcntl(fd, F_GETFD) < 0)
      static_cast<void>(open("/dev/null", kModes[fd]));  // the lowest free descriptor is fd
  }
}

}  // namespace

int main(int argc, char** argv) {
  take_standard_streams();
  return mjsense::app::run_program(argc, argv);
}

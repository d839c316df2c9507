// SPDX-License-Identifier: Apache-2.0
// libc's streams under the names that libhdf5_shared.a uses (cmake/PythonModule.cmake).

#include <cstdio>

extern "C" {
std::FILE* mjsense_stderr = nullptr;
std::FILE* mjsense_stdout = nullptr;
}

namespace {

__attribute__((constructor)) void take_streams() {
  mjsense_stderr = stderr;
  mjsense_stdout = stdout;
}

}  // namespace

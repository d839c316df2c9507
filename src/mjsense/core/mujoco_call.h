// SPDX-License-Identifier: Apache-2.0
#pragma once
// Calls of MuJoCo functions that allocate memory. MuJoCo reports a lack of memory in two ways, both
// of which would end the process: mju_error() calls exit(), and a std::bad_alloc of its C++ code
// cannot be caught by a normal handler. libmujoco contains its own C++ run-time library and
// unwinder, which crashes in the first stack frame of mjsense that has destructors to run.

#include <mujoco/mujoco.h>

#include <tuple>
#include <type_traits>
#include <utility>

namespace mjsense {

// Runs call(argument). An error or C++ exception of MuJoCo becomes a RuntimeError. `call` must not
// have local objects with destructors.
void run_mujoco(void (*call)(void*), void* argument);

// call_mujoco(mj_compile, spec, vfs): the function's result; throws RuntimeError if MuJoCo fails.
template <class Result, class... Parameters>
Result call_mujoco(Result (*function)(Parameters...),
                   std::type_identity_t<Parameters>... arguments) {
  static_assert((std::is_trivially_copyable_v<Parameters> && ...));
  struct Call {
    Result (*function)(Parameters...);
    std::tuple<Parameters...> arguments;
    Result result;
  } made{function, {arguments...}, {}};
  run_mujoco(
      [](void* p) {
        auto& [f, a, result] = *static_cast<Call*>(p);
        result = std::apply(f, a);
      },
      &made);
  return made.result;
}

}  // namespace mjsense

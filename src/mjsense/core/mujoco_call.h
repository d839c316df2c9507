// SPDX-License-Identifier: Apache-2.0
#pragma once
// Calls of MuJoCo functions that allocate memory. MuJoCo reports a lack of memory in two ways, both of which would end the process:
// mju_error() calls exit(), and a std::bad_alloc of its C++ code cannot be caught here, because libmujoco contains a C++ run-time library
// and an unwinder of its own, which crashes in the first of our stack frames that has something to clean up.

#include <mujoco/mujoco.h>

#include <tuple>
#include <type_traits>
#include <utility>

namespace mjsense {

// Runs call(argument). An error or C++ exception of MuJoCo becomes a RuntimeError. `call` must hold nothing with a destructor.
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

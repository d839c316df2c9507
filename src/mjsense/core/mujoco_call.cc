// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/mujoco_call.h"

#include <unwind.h>

#include <csetjmp>
#include <cstdio>

#include "mjsense/core/error.h"

// Exported for MuJoCo's own Python bindings: the calling thread's log handler; null: the process's.
extern "C" mjfLogHandler _mjPRIVATE_setTlsLogHandler(mjfLogHandler handler);
extern "C" mjfLogHandler _mjPRIVATE_getGlobalLogHandler();

// Runs call(argument) in a stack frame with the personality routine below (call_in_frame_*.S). An
// unwinder calls the personality routine of a frame to find out whether the frame handles an
// exception. Those of C++ compilers call back into the unwinder of their own run-time library; this
// one does not.
extern "C" void mjsense_call_in_frame(void (*call)(void*), void* argument);
extern "C" [[gnu::used, gnu::visibility("hidden")]] _Unwind_Reason_Code mjsense_personality(
    int, _Unwind_Action, _Unwind_Exception_Class, _Unwind_Exception*, _Unwind_Context*);

namespace mjsense {
namespace {

struct Trap {
  std::jmp_buf back;
  mjfLogHandler previous = nullptr;
  char error[1024] = "";
};
thread_local Trap* trap = nullptr;  // the innermost of this thread

void on_message(const mjLogMessage* message) {
  if (message->level == mjLOG_ERROR) {
    std::snprintf(trap->error, sizeof trap->error, "%s", message->subject);
    std::longjmp(trap->back, 1);
  }
  const mjfLogHandler next = trap->previous ? trap->previous : _mjPRIVATE_getGlobalLogHandler();
  if (next) next(message);
}

// False if MuJoCo failed. No object with a destructor may live here.
bool run_trapped(Trap& mine, void (*call)(void*), void* argument) {
  Trap* const outer = trap;
  trap = &mine;
  mine.previous = _mjPRIVATE_setTlsLogHandler(on_message);
  const bool failed = setjmp(mine.back) != 0;
  if (!failed) mjsense_call_in_frame(call, argument);
  _mjPRIVATE_setTlsLogHandler(mine.previous);
  trap = outer;
  return !failed;
}

}  // namespace

void run_mujoco(void (*call)(void*), void* argument) {
  Trap mine;
  if (!run_trapped(mine, call, argument)) throw RuntimeError(mine.error);
}

}  // namespace mjsense

// In the first phase an unwinder searches for a handler. When it calls this routine in the second
// phase, it has cleaned up all frames below this one, so the unwinder can be left.
_Unwind_Reason_Code mjsense_personality(int, _Unwind_Action actions, _Unwind_Exception_Class,
                                        _Unwind_Exception* exception, _Unwind_Context*) {
  if (actions & _UA_FORCE_UNWIND) return _URC_CONTINUE_UNWIND;  // a thread is cancelled
  if (actions & _UA_SEARCH_PHASE) return _URC_HANDLER_FOUND;
  if (!(actions & _UA_HANDLER_FRAME)) return _URC_CONTINUE_UNWIND;
  if (exception->exception_cleanup)
    exception->exception_cleanup(_URC_FOREIGN_EXCEPTION_CAUGHT, exception);
  mjsense::Trap* const mine = mjsense::trap;
  std::snprintf(mine->error, sizeof mine->error,
                "MuJoCo ran out of memory, or a size in the model is too large");
  std::longjmp(mine->back, 1);
}

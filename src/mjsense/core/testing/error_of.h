// SPDX-License-Identifier: Apache-2.0
#pragma once
// Messages of errors, for tests that compare them.

#include <string>

#include "mjsense/core/error.h"

namespace mjsense {

// The message of the error that `call` throws; "" if it throws none. Errors of other types than
// `Expected` are not caught.
template <class Expected = Error, class Call>
std::string error_of(Call&& call) {
  try {
    static_cast<void>(call());
  } catch (const Expected& error) {
    return error.what();
  }
  return "";
}

}  // namespace mjsense

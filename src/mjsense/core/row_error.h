// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {

// Rows that could not be computed, at most one fault per world. The episodes of these worlds cannot
// continue. All other rows of the call are valid, and the episodes of other worlds continue.
struct RowError : ValueError {
  struct Fault {
    int world;
    std::string text;  // names the sensor and the world
  };
  RowError(int world, const std::string& text) : RowError(std::vector<Fault>{{world, text}}) {}
  explicit RowError(std::vector<Fault> faults)
      : ValueError(faults.at(0).text), faults(std::move(faults)) {}
  std::vector<Fault> faults;
};

}  // namespace mjsense

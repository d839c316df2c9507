// SPDX-License-Identifier: Apache-2.0
#pragma once
// The numbers of a sensor as JSON text, one text a step: {"arm":[0.1,0.2],"base":[]}.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense {

// The fields of a sensor as the members of one object. The name of a field is a path: "arm" is a
// member, "gripper/held" one of the object "gripper". A scalar is a value, a row of numbers a list;
// floats are widened to double first. A bool field "given/arm" is not written: where it is false,
// "arm" is left out.
class JsonRows {
 public:
  // True if every field has a name and is a number or a row of them.
  static bool suits(const Sensor& sensor);
  // Throws ValueError if the longest text needs more than `text_bytes`, or if one field would stand
  // inside another.
  JsonRows(const Sensor& sensor, int text_bytes);

  // What is kept of a step until its text is written: the rows of the fields, one after the other.
  std::size_t row_bytes() const { return row_bytes_; }
  void copy(int world, std::uint8_t* row) const;
  void write(const std::uint8_t* row, std::span<std::uint8_t> text) const;  // 0 beyond the text

 private:
  struct Member {
    std::vector<std::string> path;  // {"gripper", "held"}
    const Field* field;
    std::size_t at;                // of its numbers in a kept row
    const Field* given = nullptr;  // null: always
    std::size_t given_at = 0;      // of its flag
  };
  std::size_t longest() const;

  std::vector<Member> members_;  // as JSON sorts them
  std::size_t row_bytes_ = 0;
};

}  // namespace mjsense

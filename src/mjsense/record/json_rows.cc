// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/json_rows.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "mjsense/core/error.h"
#include "mjsense/core/text/json.h"

namespace mjsense::record {
namespace {

constexpr std::string_view kGiven = "given/";
// Longest text of a number, "-1.2345678901234567e-123", and a comma.
constexpr std::size_t kNumberBytes = 25;

std::vector<std::string> split(std::string_view path) {
  std::vector<std::string> parts;
  for (std::size_t start = 0; start <= path.size();) {
    const std::size_t end = std::min(path.find('/', start), path.size());
    parts.emplace_back(path.substr(start, end - start));
    start = end + 1;
  }
  return parts;
}

// Reads an element of a kept row; elements are not aligned.
template <class T>
T read(const std::uint8_t* at) {
  T x;
  std::memcpy(&x, at, sizeof x);
  return x;
}

void write_element(JsonWriter& json, DType dtype, const std::uint8_t* at) {
  switch (dtype) {
    case DType::kFloat32:
      json.value(static_cast<double>(read<float>(at)));
      break;
    case DType::kFloat64:
      json.value(read<double>(at));
      break;
    case DType::kUint8:
      json.value(static_cast<std::int64_t>(*at));
      break;
    case DType::kUint16:
      json.value(static_cast<std::int64_t>(read<std::uint16_t>(at)));
      break;
    case DType::kInt32:
      json.value(static_cast<std::int64_t>(read<std::int32_t>(at)));
      break;
    case DType::kInt64:
      json.value(read<std::int64_t>(at));
      break;
    case DType::kBool:
      json.value(*at != 0);
      break;
  }
}

}  // namespace

bool JsonRows::can_convert(const Sensor& sensor) {
  return !sensor.fields().empty() && std::ranges::all_of(sensor.fields(), [](const Field& field) {
    return !field.name.empty() && field.spec.storage == Storage::kArray && !field.spec.is_dict &&
           field.spec.shape.rank() <= 1;
  });
}

JsonRows::JsonRows(const Sensor& sensor, int text_bytes) {
  for (const Field& field : sensor.fields()) {
    if (!field.name.starts_with(kGiven))
      members_.push_back({.path = split(field.name), .field = &field, .at = row_bytes_});
    row_bytes_ += field.data.row_bytes();
  }
  std::size_t at = 0;
  for (const Field& field : sensor.fields()) {
    for (Member& member : members_) {
      if (field.name.starts_with(kGiven) &&
          field.name.substr(kGiven.size()) == member.field->name) {
        member.given = &field;
        member.given_at = at;
      }
    }
    at += field.data.row_bytes();
  }
  std::ranges::sort(members_, {}, &Member::path);
  for (std::size_t i = 1; i < members_.size(); ++i) {
    const Member &a = members_[i - 1], &b = members_[i];
    if (std::ranges::mismatch(a.path, b.path).in1 == a.path.end()) {
      throw ValueError(
          fmt::format("sensor '{}': the JSON of field '{}' would contain that of field '{}'; "
                      "rename one of them",
                      sensor.name(), a.field->name, b.field->name));
    }
  }
  if (longest() > static_cast<std::size_t>(text_bytes)) {
    throw ValueError(fmt::format("sensor '{}': its text can need {} bytes; its rows have {}",
                                 sensor.name(), longest(), text_bytes));
  }
}

std::size_t JsonRows::longest() const {
  std::size_t bytes = 2;
  for (const Member& member : members_) {
    for (const std::string& key : member.path) {
      JsonWriter json({});
      json.begin_object().key(key);
      bytes += json.size() + 2;  // braces and a comma
    }
    bytes += 1 + member.field->spec.shape.size() * kNumberBytes;
  }
  return bytes;
}

void JsonRows::copy(int world, std::uint8_t* row) const {
  for (const Member& member : members_) {
    const Array& data = member.field->data;
    if (data.row_bytes() > 0) std::memcpy(row + member.at, data.row_data(world), data.row_bytes());
    if (member.given) std::memcpy(row + member.given_at, member.given->data.row_data(world), 1);
  }
}

void JsonRows::write(const std::uint8_t* row, std::span<std::uint8_t> text) const {
  JsonWriter json(text);
  json.begin_object();
  std::span<const std::string> open;  // the objects below the root that are still open
  const auto close_to = [&](std::size_t depth) {
    for (; open.size() > depth; open = open.first(open.size() - 1)) json.end_object();
  };
  for (const Member& member : members_) {
    if (member.given && row[member.given_at] == 0) continue;
    const std::span<const std::string> objects(member.path.data(), member.path.size() - 1);
    const auto same = std::ranges::mismatch(open, objects).in1 - open.begin();
    close_to(static_cast<std::size_t>(same));
    for (const std::string& key : objects.subspan(same)) json.key(key).begin_object();
    open = objects;
    json.key(member.path.back());
    const SensorSpec& spec = member.field->spec;
    const std::uint8_t* at = row + member.at;
    if (spec.shape.rank() > 0) json.begin_array();
    for (std::int64_t i = 0; i < spec.shape.size(); ++i) {
      write_element(json, spec.dtype, at);
      at += dtype_size(spec.dtype);
    }
    if (spec.shape.rank() > 0) json.end_array();
  }
  close_to(0);
  json.end_object();
  if (!json.finish()) {
    throw RuntimeError(fmt::format("a row of JSON needs {} bytes; the rows of its stream have {}",
                                   json.size(), text.size()));
  }
}

}  // namespace mjsense::record

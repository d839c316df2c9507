// SPDX-License-Identifier: Apache-2.0
#pragma once
// RAII wrapper of the HDF5 C API: identifiers with owners, errors as exceptions, and file
// properties that make files with the same data identical byte for byte. The serial HDF5 library is
// not thread-safe: hold an H5Lock while using anything in this file.

#include <hdf5.h>

#include <cstdint>
#include <filesystem>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/files/file_size_limit.h"

namespace mjsense::hdf5 {

class H5Lock {
 public:
  H5Lock();
  // Disables locking in the child of a fork, which has a single thread: the mutex is still held by
  // a thread of the parent.
  static void alone();

 private:
  FileLimitGuard limit_;  // the library may write to the file at any time
  std::unique_lock<std::recursive_mutex> lock_;
};

// An HDF5 identifier and the function that closes it.
class Id {
 public:
  Id() = default;
  // `what`: prefix of the error that is thrown if `id` is negative.
  Id(hid_t id, herr_t (*close)(hid_t), std::string_view what);
  ~Id() { reset(); }
  Id(Id&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
  Id& operator=(Id&& other) noexcept;
  Id(const Id&) = delete;
  Id& operator=(const Id&) = delete;

  operator hid_t() const { return id_; }
  bool valid() const { return id_ >= 0; }
  void reset();
  // Throws RuntimeError if closing fails. For files, closing is when buffers are written to disk.
  void close(std::string_view what);

 private:
  hid_t id_ = -1;
  herr_t (*close_)(hid_t) = nullptr;
};

// Throws RuntimeError "what: <HDF5's message>" if `status` is negative.
void check(herr_t status, std::string_view what);

// Replaces an existing file. A symbolic link is replaced, not followed. `shown` is the name in
// messages, if it is not the path.
Id create_file(const std::filesystem::path& path, std::string_view shown = "");
Id open_file(const std::filesystem::path& path, bool writable = false, std::string_view shown = "");
// Creates the group and its missing parents, or opens an existing group.
Id create_group(hid_t parent, const std::string& path);
Id group_properties();  // creation properties without time stamps
Id dataset_properties();
Id link_properties();  // create missing groups, names in UTF-8

// The type of bool is the enum {FALSE, TRUE} of int8, which h5py reads as bool.
Id memory_type(DType dtype);
Id text_type();  // variable-length UTF-8

// Whether every part of the path exists and is a hard link.
bool exists(hid_t parent, const std::string& path);
// Names of the links, sorted by code point. Throws RuntimeError if there are more than 100,000.
std::vector<std::string> children(hid_t group);
std::vector<hsize_t> dims(hid_t dataset);

// Writes a scalar dataset.
Id write_text(hid_t parent, const std::string& path, std::string_view text);
// Reads one text of variable or fixed length, at most 16 MiB. Throws RuntimeError for anything
// else.
std::string read_text(hid_t parent, const std::string& path);

void set_attribute(hid_t object, const char* name, std::string_view value);
void set_attribute(hid_t object, const char* name, double value);
void set_attribute(hid_t object, const char* name, std::int64_t value);
void set_attribute(hid_t object, const char* name, std::uint64_t value);
void set_attribute(hid_t object, const char* name, std::span<const std::uint64_t> values,
                   std::span<const hsize_t> dims);
// Creates a text attribute whose value is written later. Creating it together with the other
// attributes of its object makes it a third cheaper.
Id create_text_attribute(hid_t object, const char* name);
void write_text_attribute(hid_t attribute, std::string_view value);
bool has_attribute(hid_t object, const char* name);
// Attributes with one text ("" if absent) or one number (`otherwise` if absent). Throw RuntimeError
// for anything else.
std::string text_attribute(hid_t object, const char* name);
std::int64_t int_attribute(hid_t object, const char* name, std::int64_t otherwise);
double double_attribute(hid_t object, const char* name, double otherwise);

}  // namespace mjsense::hdf5

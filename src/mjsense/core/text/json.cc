// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/text/json.h"

#include <charconv>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>

#include "mjsense/core/text/utf8.h"

namespace mjsense {

void JsonWriter::put(char c) {
  if (size_ < row_.size()) row_[size_] = static_cast<std::uint8_t>(c);
  ++size_;
}

void JsonWriter::put(std::string_view text) {
  if (size_ + text.size() <= row_.size())
    std::memcpy(row_.data() + size_, text.data(), text.size());
  size_ += text.size();
}

void JsonWriter::separate() {
  if (comma_) put(',');
  comma_ = true;
}

JsonWriter& JsonWriter::begin_object() {
  separate();
  put('{');
  comma_ = false;
  if (++depth_ == kMaxDepth) throw std::logic_error("JsonWriter: nested too deeply");
  levels_[depth_].length = -1;
  return *this;
}

JsonWriter& JsonWriter::end_object() {
  put('}');
  comma_ = true;
  --depth_;
  return *this;
}

JsonWriter& JsonWriter::begin_array() {
  separate();
  put('[');
  comma_ = false;
  if (++depth_ == kMaxDepth) throw std::logic_error("JsonWriter: nested too deeply");
  return *this;
}

JsonWriter& JsonWriter::end_array() {
  put(']');
  comma_ = true;
  --depth_;
  return *this;
}

JsonWriter& JsonWriter::key(std::string_view name) {
  Level& level = levels_[depth_];
  if (name.size() <= kMaxKey) {
    if (level.length >= 0 && std::string_view(level.last, level.length) >= name) {
      throw std::logic_error("JsonWriter: key '" + std::string(name) + "' is out of order");
    }
    std::memcpy(level.last, name.data(), name.size());
    level.length = static_cast<int>(name.size());
  }
  separate();
  string(name);
  put(':');
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::value(double x) {
  char text[32];
  separate();
  if (finite_only_ && !std::isfinite(x)) {
    put("null");
    return *this;
  }
  put(std::string_view(text, format_python_float(x, text)));
  return *this;
}

JsonWriter& JsonWriter::value(std::int64_t x) { return integer(x); }
JsonWriter& JsonWriter::value(std::uint64_t x) { return integer(x); }

JsonWriter& JsonWriter::integer(auto x) {
  char text[24];
  const auto end = std::to_chars(text, text + sizeof text, x).ptr;
  separate();
  put(std::string_view(text, end - text));
  return *this;
}

JsonWriter& JsonWriter::value(bool x) {
  separate();
  put(x ? "true" : "false");
  return *this;
}

JsonWriter& JsonWriter::value(std::string_view text) {
  separate();
  string(text);
  return *this;
}

JsonWriter& JsonWriter::values(std::span<const double> xs) {
  begin_array();
  for (double x : xs) value(x);
  return end_array();
}

// As Python's ensure_ascii: UTF-8 is decoded and written as \uXXXX, with a surrogate pair beyond
// the basic multilingual plane. A byte that is not UTF-8 becomes U+FFFD.
void JsonWriter::string(std::string_view text) {
  auto escape = [this](unsigned code) {
    constexpr char kHex[] = "0123456789abcdef";
    const char u[6] = {
        '\\',           'u', kHex[code >> 12 & 15], kHex[code >> 8 & 15], kHex[code >> 4 & 15],
        kHex[code & 15]};
    put(std::string_view(u, 6));
  };
  put('"');
  for (std::size_t i = 0; i < text.size();) {
    const auto c = static_cast<unsigned char>(text[i]);
    if (c < 0x80) {
      ++i;
      switch (c) {
        case '"':
          put("\\\"");
          break;
        case '\\':
          put("\\\\");
          break;
        case '\n':
          put("\\n");
          break;
        case '\r':
          put("\\r");
          break;
        case '\t':
          put("\\t");
          break;
        case '\b':
          put("\\b");
          break;
        case '\f':
          put("\\f");
          break;
        default:
          if (c < 0x20)
            escape(c);
          else
            put(static_cast<char>(c));
      }
      continue;
    }
    const std::size_t size = utf8_size(text.substr(i));
    if (size == 0) {
      escape(0xFFFD);
      ++i;
      continue;
    }
    unsigned code = c & (0x7Fu >> size);
    for (std::size_t k = 1; k < size; ++k)
      code = code << 6 | (static_cast<unsigned char>(text[i + k]) & 0x3Fu);
    i += size;
    if (code >= 0x10000) {
      escape(0xD800 + ((code - 0x10000) >> 10));
      escape(0xDC00 + ((code - 0x10000) & 0x3FF));
    } else {
      escape(code);
    }
  }
  put('"');
}

bool JsonWriter::finish() {
  if (!fits()) return false;
  std::memset(row_.data() + size_, 0, row_.size() - size_);
  return true;
}

int format_python_float(double x, char* out) {
  auto copy = [out](std::string_view text) {
    std::memcpy(out, text.data(), text.size());
    return static_cast<int>(text.size());
  };
  if (std::isnan(x)) return copy("NaN");
  if (std::isinf(x)) return copy(x > 0 ? "Infinity" : "-Infinity");
  if (x == 0.0) return copy(std::signbit(x) ? "-0.0" : "0.0");
  // Shortest digits in scientific form, then formatted as repr() does: the exponent is written if
  // it is below -4 or at least 16.
  char sci[32];
  const char* end = std::to_chars(sci, sci + sizeof sci, x, std::chars_format::scientific).ptr;
  const char* p = sci;
  char* o = out;
  if (*p == '-') *o++ = *p++;
  char digits[20];
  int n = 0;
  for (; *p != 'e'; ++p) {
    if (*p != '.') digits[n++] = *p;
  }
  ++p;
  int exponent = 0;
  std::from_chars(*p == '+' ? p + 1 : p, end, exponent);
  if (exponent < -4 || exponent >= 16) {
    *o++ = digits[0];
    if (n > 1) {
      *o++ = '.';
      std::memcpy(o, digits + 1, n - 1);
      o += n - 1;
    }
    *o++ = 'e';
    *o++ = exponent < 0 ? '-' : '+';
    const int e = std::abs(exponent);
    if (e < 10) *o++ = '0';
    o = std::to_chars(o, o + 4, e).ptr;
  } else if (exponent < 0) {
    *o++ = '0';
    *o++ = '.';
    for (int i = -1; i > exponent; --i) *o++ = '0';
    std::memcpy(o, digits, n);
    o += n;
  } else {
    for (int i = 0; i <= exponent; ++i) *o++ = i < n ? digits[i] : '0';
    *o++ = '.';
    if (n <= exponent + 1) *o++ = '0';
    for (int i = exponent + 1; i < n; ++i) *o++ = digits[i];
  }
  return static_cast<int>(o - out);
}

}  // namespace mjsense

// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/small_text.h"

#include <cctype>
#include <cstddef>

namespace mjsense {
namespace {

constexpr int kScale = 2, kColumns = 3, kRows = 5;

// Five rows of three pixels, a digit each: 2 is the middle one, 7 all three.
const char* glyph(char c) {
  static constexpr const char* kDigits[] = {"25552", "26227", "71747", "71717", "55711",
                                            "74717", "74757", "71244", "75757", "75717"};
  static constexpr const char* kLetters[] = {
      "25755", "65656", "34443", "65556", "74647", "74644", "34553", "55755", "72227",
      "11152", "55655", "44447", "57755", "65555", "75557", "65644", "25573", "65655",
      "34216", "72222", "55557", "55552", "55775", "55255", "55222", "71247"};
  if (c >= '0' && c <= '9') return kDigits[c - '0'];
  const int letter = std::toupper(static_cast<unsigned char>(c)) - 'A';
  if (letter >= 0 && letter < 26) return kLetters[letter];
  switch (c) {
    case '.':
      return "00002";
    case ',':
      return "00024";
    case ':':
      return "02020";
    case '/':
      return "11244";
    case '_':
      return "00007";
    case '-':
      return "00700";
    case '+':
      return "02720";
    case '(':
      return "12221";
    case ')':
      return "42224";
    case '%':
      return "51245";
    case '=':
      return "07070";
    default:
      return "00000";
  }
}

}  // namespace

void draw_text(std::span<std::uint8_t> rgb, int width, int x, int y, std::string_view text) {
  for (const char c : text) {
    const char* rows = glyph(c);
    for (int dy = 0; dy < kRows * kScale; ++dy) {
      for (int dx = 0; dx < kColumns * kScale; ++dx) {
        const bool on = (rows[dy / kScale] - '0') >> (kColumns - 1 - dx / kScale) & 1;
        const std::size_t at = (static_cast<std::size_t>(y + dy) * width + x + dx) * 3;
        if (!on || x + dx >= width || at + 2 >= rgb.size()) continue;
        rgb[at] = rgb[at + 1] = rgb[at + 2] = 225;
      }
    }
    x += (kColumns + 1) * kScale;
  }
}

}  // namespace mjsense

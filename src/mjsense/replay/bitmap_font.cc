// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/bitmap_font.h"

#include <cstddef>
#include <iterator>

namespace mjsense::replay {
namespace {

constexpr int kScale = 2, kColumns = 5, kRows = 9;
static_assert(kRows * kScale == kTextHeight && (kColumns + 1) * kScale == kTextAdvance);

// One base-32 digit per row, from the top; its bits are the pixels from left to right: e is .###.
// and h is #...#. The baseline is below the seventh row; missing rows are empty. To be
// distinguishable from O, 0 has a stroke and D has corners.
// clang-format off
constexpr std::string_view kGlyphs[] = {
    "",                                                   // space
    "4444404", "aa", "aavavaa", "4fke5u4", "op248j3",     // ! " # $ %
    "cik8lid", "448", "2488842", "8422248", "04lel4",     // & ' ( ) *
    "044v44", "00000cc48", "000v", "00000cc", "01248g",   // + , - . /
    "ehjlphe", "4c4444e", "eh1248v", "v2421he",           // 0 1 2 3
    "26aiv22", "vgu11he", "68guhhe", "v124888",           // 4 5 6 7
    "ehhehhe", "ehhf12c",                                 // 8 9
    "0cc0cc", "0cc0c48", "248g842", "00v0v", "8421248",   // : ; < = >
    "eh12404", "eh1dlle",                                 // ? @
    "ehhvhhh", "uhhuhhu", "ehggghe", "sihhhis",           // A B C D
    "vggvggv", "vggvggg", "ehgnhhf", "hhhvhhh",           // E F G H
    "e44444e", "72222ic", "hikokih", "ggggggv",           // I J K L
    "hrllhhh", "hhpljhh", "ehhhhhe", "uhhuggg",           // M N O P
    "ehhhlid", "uhhukih", "fgge11u", "v444444",           // Q R S T
    "hhhhhhe", "hhhhha4", "hhhllla", "hha4ahh",           // U V W X
    "hha4444", "v1248gv",                                 // Y Z
    "e88888e", "0g8421", "e22222e", "4ah", "0000000v",    // [ \ ] ^ _
    "842",                                                // `
    "00e1fhf", "ggmphhu", "00egghe", "11djhhf",           // a b c d
    "00ehvge", "698s888", "00fhhhf1e", "ggmphhh",         // e f g h
    "40c444e", "2062222ic", "ggikoki", "c44444e",      // i j k l
    "00qllll", "00mphhh", "00ehhhe", "00uhhhugg",         // m n o p
    "00fhhhf11", "00mpggg", "00fge1u", "88s8896",         // q r s t
    "00hhhjd", "00hhha4", "00hhlla", "00ha4ah",           // u v w x
    "00hhhhf1e", "00v248v",                               // y z
    "2448442", "4444444", "8442448", "008l2",             // { | } ~
};
// clang-format on
static_assert(std::size(kGlyphs) == '~' - ' ' + 1);
constexpr std::string_view kOther = "vhhhhhv";

std::string_view glyph(char c) { return c >= ' ' && c <= '~' ? kGlyphs[c - ' '] : kOther; }

bool is_on(std::string_view rows, int x, int y) {
  if (y >= static_cast<int>(rows.size())) return false;
  const int bits = rows[y] <= '9' ? rows[y] - '0' : rows[y] - 'a' + 10;
  return (bits >> (kColumns - 1 - x) & 1) != 0;
}

}  // namespace

void draw_text(std::span<std::uint8_t> rgb, int width, int x, int y, std::string_view text) {
  for (const char c : text) {
    const std::string_view rows = glyph(c);
    for (int dy = 0; dy < kRows * kScale; ++dy) {
      for (int dx = 0; dx < kColumns * kScale; ++dx) {
        const std::size_t at = (static_cast<std::size_t>(y + dy) * width + x + dx) * 3;
        if (x + dx >= width || at + 2 >= rgb.size()) continue;
        if (is_on(rows, dx / kScale, dy / kScale)) rgb[at] = rgb[at + 1] = rgb[at + 2] = 225;
      }
    }
    x += kTextAdvance;
  }
}

}  // namespace mjsense::replay

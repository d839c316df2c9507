// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/generators/room_writer.h"

#include <fmt/format.h>

namespace mjsense::scenes {
namespace {

std::string named(std::string_view name) {
  return name.empty() ? "" : fmt::format("name=\"{}\" ", name);
}

std::string text(Vec3 v) { return fmt::format("{:.5g} {:.5g} {:.5g}", v.x, v.y, v.z); }

std::string gloss_text(Gloss gloss) {
  return fmt::format("specular=\"{}\" shininess=\"{}\" reflectance=\"{}\"", gloss.specular,
                     gloss.shininess, gloss.reflectance);
}

// Axes of a side that faces this direction: x to the right and y up in the texture, z outwards.
const char* axes(Facing facing) {
  switch (facing) {
    case Facing::kUp:
      return "1 0 0 0 1 0";
    case Facing::kDown:
      return "1 0 0 0 -1 0";
    case Facing::kPlusX:
      return "0 1 0 0 0 1";
    case Facing::kMinusX:
      return "0 -1 0 0 0 1";
    case Facing::kPlusY:
      return "-1 0 0 0 0 1";
    case Facing::kMinusY:
      break;
  }
  return "1 0 0 0 0 1";
}

Vec3 normal(Facing facing) {
  switch (facing) {
    case Facing::kUp:
      return {0, 0, 1};
    case Facing::kDown:
      return {0, 0, -1};
    case Facing::kPlusX:
      return {1, 0, 0};
    case Facing::kMinusX:
      return {-1, 0, 0};
    case Facing::kPlusY:
      return {0, 1, 0};
    case Facing::kMinusY:
      break;
  }
  return {0, -1, 0};
}

}  // namespace

void RoomWriter::plain(std::string_view name, Colour c, Gloss gloss, double alpha) {
  assets_ += fmt::format("<material name=\"{}\" rgba=\"{:.4f} {:.4f} {:.4f} {}\" {}/>\n", name,
                         c[0], c[1], c[2], alpha, gloss_text(gloss));
}

void RoomWriter::glowing(std::string_view name, Colour c, double emission) {
  assets_ += fmt::format(
      "<material name=\"{}\" rgba=\"{:.4f} {:.4f} {:.4f} 1\" emission=\"{}\" specular=\"0\"/>\n",
      name, c[0], c[1], c[2], emission);
}

void RoomWriter::texture(std::string_view name, std::string png, bool wrapped) {
  const std::string file = fmt::format("{}_{}.png", name_, name);
  assets_ += fmt::format("<texture name=\"{}\" type=\"{}\" file=\"{}\"/>\n", name,
                         wrapped ? "cube" : "2d", file);
  files_[file] = std::move(png);
}

void RoomWriter::tiled(std::string_view name, std::string png, double metres, Gloss gloss) {
  texture(name, std::move(png), false);
  // With texuniform, texrepeat is the number of repetitions per metre.
  assets_ += fmt::format(
      "<material name=\"{0}\" texture=\"{0}\" texuniform=\"true\" texrepeat=\"{1} {1}\" {2}/>\n",
      name, 1 / metres, gloss_text(gloss));
}

void RoomWriter::wrapped(std::string_view name, std::string png, Gloss gloss) {
  texture(name, std::move(png), true);
  assets_ += fmt::format("<material name=\"{0}\" texture=\"{0}\" {1}/>\n", name, gloss_text(gloss));
}

void RoomWriter::box(std::string_view name, std::string_view material, Vec3 middle, Vec3 half,
                     std::string_view more) {
  world_ += fmt::format(
      "<geom {}class=\"furniture\" type=\"box\" pos=\"{}\" size=\"{}\" material=\"{}\" {}/>\n",
      named(name), text(middle), text(half), material, more);
}

void RoomWriter::slab(std::string_view name, std::string_view material, Facing facing, Vec3 middle,
                      double wide, double high, double thick, std::string_view more) {
  world_ += fmt::format(
      "<geom {}class=\"furniture\" type=\"box\" pos=\"{}\" xyaxes=\"{}\" size=\"{:.5g} {:.5g} "
      "{:.5g}\" material=\"{}\" {}/>\n",
      named(name), text(middle - 0.5 * thick * normal(facing)), axes(facing), wide / 2, high / 2,
      thick / 2, material, more);
}

void RoomWriter::cylinder(std::string_view name, std::string_view material, Vec3 from, Vec3 to,
                          double radius, std::string_view more) {
  world_ += fmt::format(
      "<geom {}class=\"furniture\" type=\"cylinder\" fromto=\"{} {}\" size=\"{:.5g}\" "
      "material=\"{}\" {}/>\n",
      named(name), text(from), text(to), radius, material, more);
}

void RoomWriter::capsule(std::string_view name, std::string_view material, Vec3 from, Vec3 to,
                         double radius, std::string_view more) {
  world_ += fmt::format(
      "<geom {}class=\"furniture\" type=\"capsule\" fromto=\"{} {}\" size=\"{:.5g}\" "
      "material=\"{}\" {}/>\n",
      named(name), text(from), text(to), radius, material, more);
}

void RoomWriter::leaf(std::string_view material, Vec3 middle, Vec3 along, Vec3 flat, Vec3 half) {
  world_ += fmt::format(
      "<geom class=\"shown\" type=\"ellipsoid\" pos=\"{}\" xyaxes=\"{} {}\" size=\"{}\" "
      "material=\"{}\"/>\n",
      text(middle), text(cross(flat, along)), text(flat), text(half), material);
}

void RoomWriter::add(std::string_view element) {
  world_ += element;
  world_ += '\n';
}

void RoomWriter::open_body(std::string_view name, Vec3 pos, double yaw) {
  world_ += fmt::format("<body {}pos=\"{}\" euler=\"0 0 {:.6g}\">\n", named(name), text(pos), yaw);
}

void RoomWriter::close_body() { world_ += "</body>\n"; }

void RoomWriter::tail(std::string_view element) {
  tail_ += element;
  tail_ += '\n';
}

scene::ModelSource RoomWriter::model() const {
  scene::ModelSource source;
  source.xml = fmt::format(
      "<mujoco model=\"{}\">\n<compiler angle=\"radian\" autolimits=\"true\"/>\n"
      "<default><geom friction=\"0.9 0.005 0.0001\"/>\n"
      "<default class=\"furniture\"><geom contype=\"0\" conaffinity=\"3\" "
      "condim=\"3\"/></default>\n"
      "<default class=\"shown\"><geom contype=\"0\" conaffinity=\"0\" group=\"2\" mass=\"0\"/>"
      "</default></default>\n<asset>\n{}</asset>\n<worldbody>\n{}</worldbody>\n{}</mujoco>\n",
      name_, assets_, world_, tail_);
  source.assets = files_;
  return source;
}

}  // namespace mjsense::scenes

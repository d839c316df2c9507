// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/room_writer.h"

#include <fmt/format.h>

namespace mjsense::tasks::scenes {
namespace {

std::string named(std::string_view name) {
  return name.empty() ? "" : fmt::format("name=\"{}\" ", name);
}

std::string text(Vec3 v) { return fmt::format("{:.5g} {:.5g} {:.5g}", v.x, v.y, v.z); }
std::string ends(Vec3 from, Vec3 to, double radius) {
  return fmt::format("fromto=\"{} {}\" size=\"{:.5g}\"", text(from), text(to), radius);
}

std::string gloss_text(Gloss gloss) {
  std::string out = fmt::format("specular=\"{}\" shininess=\"{}\" reflectance=\"{}\"",
                                gloss.specular, gloss.shininess, gloss.reflectance);
  if (gloss.metallic > 0) out += fmt::format(" metallic=\"{}\"", gloss.metallic);
  if (gloss.roughness >= 0) out += fmt::format(" roughness=\"{}\"", gloss.roughness);
  return out;
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

void RoomWriter::plain(std::string_view name, Colour c, Gloss gloss) {
  assets_ += fmt::format("<material name=\"{}\" rgba=\"{:.4f} {:.4f} {:.4f} 1\" {}/>\n", name, c[0],
                         c[1], c[2], gloss_text(gloss));
}

void RoomWriter::glowing(std::string_view name, Colour c, double emission, std::string_view shown) {
  assets_ += fmt::format(
      "<material name=\"{}\" rgba=\"{:.4f} {:.4f} {:.4f} 1\" emission=\"{}\" specular=\"0\">{}"
      "</material>\n",
      name, c[0], c[1], c[2], emission,
      shown.empty() ? "" : fmt::format("<layer texture=\"{}\" role=\"emissive\"/>", shown));
}

void RoomWriter::texture(std::string_view name, Picture picture, bool wrapped) {
  const auto add = [&](const std::string& texture, std::string png) {
    const std::string file = fmt::format("{}_{}.png", name_, texture);
    assets_ += fmt::format("<texture name=\"{}\" type=\"{}\" file=\"{}\"/>\n", texture,
                           wrapped ? "cube" : "2d", file);
    files_[file] = std::move(png);
  };
  add(std::string(name), std::move(picture.colours));
  if (!wrapped && !picture.normals.empty())
    add(fmt::format("{}_normals", name), std::move(picture.normals));
}

void RoomWriter::tiled(std::string_view name, Picture picture, double metres, Gloss gloss) {
  const std::string normals =
      picture.normals.empty()
          ? ""
          : fmt::format("<layer texture=\"{}_normals\" role=\"normal\"/>", name);
  texture(name, std::move(picture), false);
  // With texuniform, texrepeat is the number of repetitions per metre.
  assets_ += fmt::format(
      "<material name=\"{0}\" texuniform=\"true\" texrepeat=\"{1} {1}\" {2}>"
      "<layer texture=\"{0}\" role=\"rgb\"/>{3}</material>\n",
      name, 1 / metres, gloss_text(gloss), normals);
}

void RoomWriter::wrapped(std::string_view name, Picture picture, Gloss gloss) {
  texture(name, std::move(picture), true);
  assets_ += fmt::format("<material name=\"{0}\" texture=\"{0}\" {1}/>\n", name, gloss_text(gloss));
}

void RoomWriter::write_geom(std::string_view type, std::string_view place,
                            std::string_view material, const GeomOptions& options) {
  world_ += fmt::format("<geom {}class=\"furniture\" type=\"{}\" {} material=\"{}\" {}{}/>\n",
                        named(options.name), type, place, material,
                        options.solid ? "" : "contype=\"0\" conaffinity=\"0\" group=\"2\" ",
                        options.attributes);
}

void RoomWriter::box(Vec3 middle, Vec3 half, std::string_view material,
                     const GeomOptions& options) {
  write_geom("box", fmt::format("pos=\"{}\" size=\"{}\"", text(middle), text(half)), material,
             options);
}

void RoomWriter::slab(Facing facing, Vec3 middle, double wide, double high, double thick,
                      std::string_view material, const GeomOptions& options) {
  write_geom("box",
             fmt::format("pos=\"{}\" xyaxes=\"{}\" size=\"{}\"",
                         text(middle - 0.5 * thick * normal(facing)), axes(facing),
                         text({wide / 2, high / 2, thick / 2})),
             material, options);
}

void RoomWriter::cylinder(Vec3 from, Vec3 to, double radius, std::string_view material,
                          const GeomOptions& options) {
  write_geom("cylinder", ends(from, to, radius), material, options);
}

void RoomWriter::upright_cylinder(Vec3 middle, double radius, double half_height,
                                  std::string_view material, const GeomOptions& options) {
  const Vec3 up{0, 0, half_height};
  cylinder(middle - up, middle + up, radius, material, options);
}

void RoomWriter::capsule(Vec3 from, Vec3 to, double radius, std::string_view material,
                         const GeomOptions& options) {
  write_geom("capsule", ends(from, to, radius), material, options);
}

void RoomWriter::ellipsoid(Vec3 middle, Vec3 half, std::string_view material, Quat q) {
  add(fmt::format(
      "<geom class=\"shown\" type=\"ellipsoid\" pos=\"{}\" size=\"{}\" quat=\"{:.6g} {:.6g} {:.6g} "
      "{:.6g}\" material=\"{}\"/>",
      text(middle), text(half), q.w, q.x, q.y, q.z, material));
}

void RoomWriter::leaf(Vec3 middle, Vec3 along, Vec3 flat, Vec3 half, std::string_view material) {
  add(fmt::format(
      "<geom class=\"shown\" type=\"ellipsoid\" pos=\"{}\" xyaxes=\"{} {}\" size=\"{}\" "
      "material=\"{}\"/>",
      text(middle), text(cross(flat, along)), text(flat), text(half), material));
}

void RoomWriter::lamp(std::string_view name, Vec3 at, double brightness, double reach) {
  add(
      fmt::format("<light name=\"{}\" type=\"spot\" bulbradius=\"0.12\" cutoff=\"88\" "
                  "exponent=\"1\" intensity=\"2800\" pos=\"{:.4g} {:.4g} {:.4g}\" "
                  "dir=\"0 0 -1\" diffuse=\"{:.4g} {:.4g} {:.4g}\" specular=\"0.15 0.15 0.15\" "
                  "attenuation=\"1 0 {:.4g}\" castshadow=\"true\"/>",
                  name, at.x, at.y, at.z, brightness, 0.97 * brightness, 0.91 * brightness,
                  1 / (reach * reach)));
}

void RoomWriter::add(std::string_view element) {
  world_ += element;
  world_ += '\n';
}

void RoomWriter::open_body(std::string_view name, Vec3 pos, double yaw) {
  world_ += fmt::format("<body {}pos=\"{}\" euler=\"0 0 {:.6g}\">\n", named(name), text(pos), yaw);
  frames_.push_back(frame() * Pose{pos, axis_angle({0, 0, 1}, yaw)});
}

void RoomWriter::close_body() {
  world_ += "</body>\n";
  frames_.pop_back();
}

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

}  // namespace mjsense::tasks::scenes

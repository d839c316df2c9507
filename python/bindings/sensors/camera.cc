// CameraSensorCfg in Python.

#include "mjsense/sensors/camera/camera_sensor.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "python/bindings/bindings.h"
#include "python/bindings/configs.h"

namespace mjsense::python {

template <class Fields>
void fields(Fields& f, CameraIntrinsics& c) {
  f("fx", c.fx);
  f("fy", c.fy);
  f("cx", c.cx);
  f("cy", c.cy);
}

template <class Fields>
void fields(Fields& f, LensDistortion& c) {
  f("model", c.model);
  f("coefficients", c.coefficients);
}

template <class Fields>
void fields(Fields& f, CameraVizCfg& c) {
  f("show_frustum", c.show_frustum);
  f("show_frame", c.show_frame);
  f("frustum_depth", c.frustum_depth);
  f("frustum_color", c.frustum_color);
  f("line_width", c.line_width);
  f("axis_length", c.axis_length);
}

template <class Fields>
void fields(Fields& f, CameraSensorCfg& c) {
  f("name", c.name);
  f("camera_name", c.camera_name);
  f("parent_body", c.parent_body);
  f("pos", c.pos);
  f("quat", c.quat);
  f("fovy", c.fovy);
  f("width", c.width);
  f("height", c.height);
  f("data_types", c.data_types);
  f("use_textures", c.use_textures);
  f("use_shadows", c.use_shadows);
  f("enabled_geom_groups", c.enabled_geom_groups);
  f("orthographic", c.orthographic);
  f("clone_data", c.clone_data);
  f("enabled_site_groups", c.enabled_site_groups);
  f("enabled_tendon_groups", c.enabled_tendon_groups);
  f("max_lights", c.max_lights);
  f("near", c.near);
  f("far", c.far);
  f("clip_near", c.clip_near);
  f("update_period", c.update_period);
  f("phase", c.phase);
  f("samples", c.samples);
  f("depth_kind", c.depth_kind);
  f("intrinsics", c.intrinsics);
  f("distortion", c.distortion);
  f("depth_noise", c.depth_noise);
  f("renderer", c.renderer);
  f("debug_vis", c.debug_vis);
  f("viz", c.viz);
}

void bind_camera(nb::module_&) {
  add_cfg_check<CameraIntrinsics>("CameraIntrinsics");
  add_cfg_check<LensDistortion>("LensDistortion");
  add_cfg_check<CameraVizCfg>("CameraVizCfg");
}

CfgKind camera_kind() { return cfg_kind<CameraSensorCfg>("camera"); }

}  // namespace mjsense::python

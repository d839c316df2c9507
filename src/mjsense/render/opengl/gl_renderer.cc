// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/opengl/gl_renderer.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/rays/flex_shapes.h"
#include "mjsense/rays/ray_world.h"
#include "mjsense/rays/skin_shapes.h"
#include "mjsense/render/opengl/visual_fields.h"

namespace mjsense::render {
namespace {

// libEGL, loaded on first use, so that it is not required otherwise.
struct Egl {
  decltype(&eglGetError) get_error;
  decltype(&eglGetDisplay) get_display;
  decltype(&eglGetPlatformDisplay) get_platform_display;
  decltype(&eglInitialize) initialize;
  decltype(&eglBindAPI) bind_api;
  decltype(&eglChooseConfig) choose_config;
  decltype(&eglCreateContext) create_context;
  decltype(&eglDestroyContext) destroy_context;
  decltype(&eglMakeCurrent) make_current;

  explicit Egl(const std::string& context) {
    void* library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
    if (!library)
      throw RuntimeError(fmt::format("{}: OpenGL: {}; is libegl1 installed?", context, dlerror()));
    const auto find = [&](auto& function, const char* name) {
      function = reinterpret_cast<std::decay_t<decltype(function)>>(dlsym(library, name));
      if (!function) throw RuntimeError(fmt::format("{}: OpenGL: libEGL has no {}", context, name));
    };
    find(get_error, "eglGetError");
    find(get_display, "eglGetDisplay");
    find(get_platform_display, "eglGetPlatformDisplay");
    find(initialize, "eglInitialize");
    find(bind_api, "eglBindAPI");
    find(choose_config, "eglChooseConfig");
    find(create_context, "eglCreateContext");
    find(destroy_context, "eglDestroyContext");
    find(make_current, "eglMakeCurrent");
  }
};

// A context without a window, on Mesa's surfaceless platform or else the default display.
class EglContext {
 public:
  explicit EglContext(const std::string& context) : egl_(context) {
    const auto fail = [&](const char* what) {
      throw RuntimeError(
          fmt::format("{}: OpenGL: {} (EGL error {:#x}); is libgl1-mesa-dri installed?", context,
                      what, static_cast<unsigned>(egl_.get_error())));
    };
    display_ =
        egl_.get_platform_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
    if (display_ == EGL_NO_DISPLAY || !egl_.initialize(display_, nullptr, nullptr)) {
      display_ = egl_.get_display(EGL_DEFAULT_DISPLAY);
      if (display_ == EGL_NO_DISPLAY || !egl_.initialize(display_, nullptr, nullptr))
        fail("no EGL display");
    }
    egl_.bind_api(EGL_OPENGL_API);
    const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                             EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    if (!egl_.choose_config(display_, wanted, &config, 1, &count) || count < 1)
      fail("no suitable EGL configuration");
    context_ = egl_.create_context(display_, config, EGL_NO_CONTEXT, nullptr);
    if (context_ == EGL_NO_CONTEXT) fail("no context");
  }
  ~EglContext() {
    release();
    egl_.destroy_context(display_, context_);
  }
  EglContext(const EglContext&) = delete;
  EglContext& operator=(const EglContext&) = delete;

  // A context belongs to one thread at a time: take() before rendering an image, release()
  // afterwards.
  bool take() {
    return egl_.bind_api(EGL_OPENGL_API) &&
           egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_);
  }
  void release() { egl_.make_current(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT); }

 private:
  Egl egl_;
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

void flip_rows(auto* pixels, int width, int height) {
  for (int y = 0; y < height / 2; ++y)
    std::swap_ranges(pixels + y * width, pixels + (y + 1) * width,
                     pixels + (height - 1 - y) * width);
}

class MujocoGl final : public GlRenderer {
 public:
  MujocoGl(const mjModel* model, const GlRendererCfg& cfg, const std::string& context)
      : cfg_(cfg),
        error_context_(context),
        egl_(context),
        model_(call_mujoco(mj_copyModel, nullptr, model)),
        data_(call_mujoco(mj_makeData, model_.get())),
        worlds_(cfg.num_worlds, VisualFields(model)) {
    model_->vis.global.offwidth = cfg.width;
    model_->vis.global.offheight = cfg.height;
    model_->vis.quality.offsamples = cfg.samples > 1 ? cfg.samples : 0;
    colors_.resize(3 * static_cast<std::size_t>(cfg.width) * cfg.height);
    take();
    mjv_defaultScene(&scene_);
    mjv_makeScene(
        model_.get(), &scene_,
        static_cast<int>(model_->ngeom + model_->nflexelem + model_->nskin + cfg.markers) + 100);
    mjr_defaultContext(&context_);
    mjr_makeContext(model_.get(), &context_, mjFONTSCALE_100);
    mjr_setBuffer(mjFB_OFFSCREEN, &context_);
    context_.readDepthMap = mjDEPTH_ZERONEAR;
    egl_.release();
    mjv_defaultOption(&options_);
    std::fill_n(options_.sitegroup, mjNGROUP, 0);
    for (int g = 0; g < mjNGROUP; ++g)
      options_.geomgroup[g] = options_.flexgroup[g] = options_.skingroup[g] = cfg.groups >> g & 1u;
    options_.flags[mjVIS_TEXTURE] = cfg.textures;
    options_.flags[mjVIS_TENDON] = 0;
    mjv_defaultCamera(&camera_);
    camera_.type = mjCAMERA_FIXED;
    camera_.fixedcamid = cfg.camera;
  }
  ~MujocoGl() override {
    if (egl_.take()) mjr_freeContext(&context_);
    mjv_freeScene(&scene_);
  }

  void remember(int world, const mjModel* model) override { worlds_[world].copy_from(model); }

  void render(int world, const rays::RayWorld& state, std::span<const mjvGeom> markers,
              const ImageTargets& targets) override {
    show(worlds_[world]);
    pose(state);
    mjv_updateScene(model_.get(), data_.get(), &options_, nullptr, &camera_,
                    mjCAT_STATIC | mjCAT_DYNAMIC, &scene_);
    for (const mjvGeom& marker : markers) {
      scene_.geoms[scene_.ngeom] = marker;
      scene_.geoms[scene_.ngeom].segid = scene_.ngeom;
      ++scene_.ngeom;
    }
    scene_.nlight = std::min(scene_.nlight, cfg_.max_lights);
    const mjrRect all{0, 0, cfg_.width, cfg_.height};
    take();
    mjr_setBuffer(mjFB_OFFSCREEN, &context_);
    if (targets.rgb) {
      scene_.flags[mjRND_SHADOW] = cfg_.shadows;
      scene_.flags[mjRND_SKYBOX] = cfg_.textures;
      mjr_render(all, &scene_, &context_);
      mjr_readPixels(targets.rgb, nullptr, all, &context_);
    }
    // A separate pass, because the sky would write depth. It draws ids, for which MuJoCo disables
    // multisampling, so depth and ids are those of the pixel centres.
    if (targets.depth || targets.segmentation) {
      scene_.flags[mjRND_SHADOW] = scene_.flags[mjRND_SKYBOX] = 0;
      scene_.flags[mjRND_SEGMENT] = scene_.flags[mjRND_IDCOLOR] = 1;
      mjr_render(all, &scene_, &context_);
      mjr_readPixels(targets.segmentation ? colors_.data() : nullptr, targets.depth, all,
                     &context_);
      scene_.flags[mjRND_SEGMENT] = scene_.flags[mjRND_IDCOLOR] = 0;
    }
    egl_.release();
    if (targets.rgb) flip_rows(targets.rgb, 3 * cfg_.width, cfg_.height);
    if (targets.depth) convert_depth(targets.depth);
    if (targets.segmentation) convert_ids(targets.segmentation);
  }

 private:
  void take() {
    if (!egl_.take())
      throw RuntimeError(
          fmt::format("{}: OpenGL: the context is in use by another thread", error_context_));
  }

  // mjrContext keeps its own copies of the materials' texture fields.
  void show(const VisualFields& world) {
    world.copy_to(model_.get());
    if (cfg_.orthographic) model_->cam_projection[cfg_.camera] = mjPROJ_ORTHOGRAPHIC;
    if (cfg_.fovy) {
      model_->cam_fovy[cfg_.camera] = *cfg_.fovy;
      std::fill_n(model_->cam_sensorsize + 2 * cfg_.camera, 2, 0.0f);
    }
    const int count = std::min(static_cast<int>(model_->nmat), mjMAXMATERIAL);
    std::copy_n(model_->mat_texid, mjNTEXROLE * count, context_.mat_texid);
    std::copy_n(model_->mat_texuniform, count, context_.mat_texuniform);
    std::copy_n(model_->mat_texrepeat, 2 * count, context_.mat_texrepeat);
  }

  void pose(const rays::RayWorld& world) {
    for (int i = 0; i < world.num_geoms(); ++i) {
      std::copy_n(world.geom(i).pos, 3, data_->geom_xpos + 3 * i);
      std::copy_n(world.geom(i).mat, 9, data_->geom_xmat + 9 * i);
    }
    for (int f = 0; f < model_->nflex; ++f)
      std::ranges::copy(world.flexes()->vertices(f),
                        data_->flexvert_xpos + 3 * model_->flex_vertadr[f]);
    for (int i = 0; i < model_->nskin; ++i) pose_bones(i, world.skins()->bones(i));
    for (std::size_t i = 0; i < world.lights().size(); ++i) {
      std::copy_n(world.lights()[i].pos, 3, data_->light_xpos + 3 * i);
      std::copy_n(world.lights()[i].dir, 3, data_->light_xdir + 3 * i);
    }
    for (std::size_t i = 0; i < world.cameras().size(); ++i) {
      std::copy_n(world.cameras()[i].pos, 3, data_->cam_xpos + 3 * i);
      std::copy_n(world.cameras()[i].mat, 9, data_->cam_xmat + 9 * i);
    }
  }

  void pose_bones(int skin, std::span<const double> bones) {
    for (int b = 0; b < model_->skin_bonenum[skin]; ++b) {
      const int body = model_->skin_bonebodyid[model_->skin_boneadr[skin] + b];
      std::copy_n(&bones[7 * b], 3, data_->xpos + 3 * body);
      std::copy_n(&bones[7 * b + 3], 4, data_->xquat + 4 * body);
    }
  }

  // Converts the depth buffer (0 near, 1 far) to planar depth in metres, 0 for the far plane.
  void convert_depth(float* depth) const {
    const double near = model_->vis.map.znear * model_->stat.extent,
                 far = model_->vis.map.zfar * model_->stat.extent;
    const bool orthographic = model_->cam_projection[cfg_.camera] == mjPROJ_ORTHOGRAPHIC;
    for (int i = 0; i < cfg_.width * cfg_.height; ++i) {
      const double d = depth[i];
      const double z = orthographic ? near + d * (far - near) : near / (1 - d * (1 - near / far));
      depth[i] = d >= 1 ? 0.0f : static_cast<float>(z);
    }
    flip_rows(depth, cfg_.width, cfg_.height);
  }

  void convert_ids(std::int32_t* out) const {
    std::fill_n(out, 2 * cfg_.width * cfg_.height, -1);
    std::vector<const mjvGeom*> by_segment(scene_.ngeom + 1, nullptr);
    for (int i = 0; i < scene_.ngeom; ++i) {
      const int segment = scene_.geoms[i].segid;
      if (segment >= 0 && segment <= scene_.ngeom) by_segment[segment] = &scene_.geoms[i];
    }
    for (int y = 0; y < cfg_.height; ++y)
      for (int x = 0; x < cfg_.width; ++x) {
        const unsigned char* c = &colors_[3 * ((cfg_.height - 1 - y) * cfg_.width + x)];
        const int segment = (c[0] | c[1] << 8 | c[2] << 16) - 1;
        if (segment < 0 || segment > scene_.ngeom || !by_segment[segment]) continue;
        out[2 * (y * cfg_.width + x)] = by_segment[segment]->objid;
        out[2 * (y * cfg_.width + x) + 1] = by_segment[segment]->objtype;
      }
  }

  GlRendererCfg cfg_;
  std::string error_context_;
  EglContext egl_;
  struct Delete {
    void operator()(mjModel* m) const { mj_deleteModel(m); }
    void operator()(mjData* d) const { mj_deleteData(d); }
  };
  // A copy with the offscreen buffer's size; it takes the values of one world after another.
  std::unique_ptr<mjModel, Delete> model_;
  std::unique_ptr<mjData, Delete> data_;  // poses only
  std::vector<VisualFields> worlds_;
  mjvScene scene_;
  mjvOption options_;
  mjvCamera camera_;
  mjrContext context_;
  std::vector<unsigned char> colors_;
};

}  // namespace

std::unique_ptr<GlRenderer> make_gl_renderer(const mjModel* model, const GlRendererCfg& cfg,
                                             const std::string& context) {
  return std::make_unique<MujocoGl>(model, cfg, context);
}

}  // namespace mjsense::render

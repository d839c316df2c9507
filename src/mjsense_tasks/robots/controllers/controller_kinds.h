// SPDX-License-Identifier: Apache-2.0
#pragma once
// Factory functions of the controllers, each defined in its controller's file.

#include "mjsense_tasks/robots/controllers/controller.h"

namespace mjsense::tasks::robots {

template <class Cfg>
using MakeController = std::unique_ptr<Controller>(const Cfg&, const MoveGroup&,
                                                   const ControllerInit&);

MakeController<JointPositionCfg> make_kind;
MakeController<JointPositionRelativeCfg> make_kind;
MakeController<JointVelocityCfg> make_kind;
MakeController<TorsoHeightCfg> make_kind;
MakeController<HolonomicBaseCfg> make_kind;
MakeController<DifferentialBaseCfg> make_kind;
MakeController<MocapBaseCfg> make_kind;
MakeController<FreeBaseCfg> make_kind;
MakeController<EePoseCfg> make_kind;
MakeController<EeDeltaPoseCfg> make_kind;
MakeController<NoControllerCfg> make_kind;

}  // namespace mjsense::tasks::robots

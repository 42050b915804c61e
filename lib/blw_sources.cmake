# SPDX-License-Identifier: MIT
# The library as a plain list for any build system: compile BLW_SOURCES as C99 with
# -ffp-contract=off, with BLW_INCLUDE_DIRS (for users, too) and BLW_PRIVATE_DIRS as include paths;
# define BLW_REAL_DOUBLE for double.  With CMake: include(lib/blw_sources.cmake).
set(BLW_INCLUDE_DIRS ${CMAKE_CURRENT_LIST_DIR}/include)
set(BLW_PRIVATE_DIRS ${CMAKE_CURRENT_LIST_DIR}/src)
set(BLW_SOURCES
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_bank.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_bank_check.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_bank_judge.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_chi2.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_decentral.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_decentral_check.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_decentral_recursive.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_decentral_search.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_decentral_steady.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_S.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_alone.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_beside.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_gross.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_relax.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_bound.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_check.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_filters.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_one.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_search.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_solve.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_guard_strips.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_joint.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_joint_check.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_joint_recursive.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_joint_schedule.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_jordan.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_kalman.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_active_set.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_admm.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_kkt.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_refine.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_support.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_newton.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_factor.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_newton_finish.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_newton_start.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_newton_step.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_l1_tableau.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_la.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_lasso.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_local.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_model.c
  ${CMAKE_CURRENT_LIST_DIR}/src/blw_step.c)

# The libraries as CMake packages for other programs (docs/mocks-package.md):
#   find_package(sixpoint)                      files, calibration, simulation, devices: sixpoint::gt3x, ...
#   find_package(sixpoint COMPONENTS mocks)     and units that are not there: sixpoint::mocks
# `cmake --install build --component dev --prefix P` installs the first, `--component mocks` what the
# second has beyond it. Headers keep their names: #include "mocks/firmware/virtual_unit.h".
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(sixpoint_package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/sixpoint)
# sixpoint_package(COMPONENT FOLDERS folder... ROOMS room...): archives, headers and targets.
function(sixpoint_package COMPONENT)
  cmake_parse_arguments(PACKAGE "" "" "FOLDERS;ROOMS" ${ARGN})
  foreach(room ${PACKAGE_ROOMS})
    set_target_properties(sixpoint_${room} PROPERTIES EXPORT_NAME ${room})
    get_target_property(kind sixpoint_${room} TYPE)
    if(NOT kind STREQUAL INTERFACE_LIBRARY)
      target_include_directories(sixpoint_${room} PUBLIC
        $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/sixpoint>)
    endif()
    install(TARGETS sixpoint_${room} EXPORT sixpoint_${COMPONENT}
      ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/sixpoint COMPONENT ${COMPONENT})
  endforeach()
  foreach(folder ${PACKAGE_FOLDERS})
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}
      DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sixpoint COMPONENT ${COMPONENT}
      FILES_MATCHING PATTERN "*.h")
  endforeach()
  install(EXPORT sixpoint_${COMPONENT} NAMESPACE sixpoint::
    FILE sixpoint-${COMPONENT}-targets.cmake
    DESTINATION ${sixpoint_package_folder} COMPONENT ${COMPONENT})
endfunction()

sixpoint_package(dev
  FOLDERS base gt3x calib sim device
  ROOMS
    base base_text gt3x_container gt3x_log gt3x_forms gt3x gt3x_rows
    calib_sums calib calib_poses calib_application sim_effects sim
    device device_wire device_usb device_session device_jigs device_drive)
sixpoint_package(mocks
  FOLDERS mocks
  ROOMS mocks_firmware mocks_faults mocks_in_process mocks_usb mocks_inert mocks)

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/sixpoint-config.cmake.in
  ${PROJECT_BINARY_DIR}/sixpoint-config.cmake INSTALL_DESTINATION ${sixpoint_package_folder})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sixpoint-config-version.cmake
  COMPATIBILITY SameMajorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sixpoint-config.cmake
  ${PROJECT_BINARY_DIR}/sixpoint-config-version.cmake
  DESTINATION ${sixpoint_package_folder} COMPONENT dev)

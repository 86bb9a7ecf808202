# The mocks as a CMake package for other people's tests (docs/mocks-package.md):
#   find_package(sixpoint COMPONENTS mocks)
#   target_link_libraries(my_tests PRIVATE sixpoint::mocks)
# `cmake --install build --component mocks --prefix P` installs it alone. The rooms that the mocks
# stand on come along; headers keep their names: #include "mocks/firmware/virtual_unit.h".
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

set(sixpoint_package_folders base gt3x calib sim device mocks)
set(sixpoint_package_rooms
  base gt3x_container gt3x_log gt3x_forms gt3x calib_sums calib sim_effects sim
  device device_wire device_usb device_session device_jigs device_drive
  mocks_firmware mocks_faults mocks_in_process mocks_usb mocks_inert mocks)
set(sixpoint_package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/sixpoint)
foreach(room ${sixpoint_package_rooms})
  set_target_properties(sixpoint_${room} PROPERTIES EXPORT_NAME ${room})
  get_target_property(kind sixpoint_${room} TYPE)
  if(NOT kind STREQUAL INTERFACE_LIBRARY)
    target_include_directories(sixpoint_${room} PUBLIC
      $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/sixpoint>)
  endif()
  install(TARGETS sixpoint_${room} EXPORT sixpoint_mocks
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/sixpoint COMPONENT mocks)
endforeach()
foreach(folder ${sixpoint_package_folders})
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${folder}
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/sixpoint COMPONENT mocks
    FILES_MATCHING PATTERN "*.h")
endforeach()
install(EXPORT sixpoint_mocks NAMESPACE sixpoint:: FILE sixpoint-mocks-targets.cmake
  DESTINATION ${sixpoint_package_folder} COMPONENT mocks)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/sixpoint-config.cmake.in
  ${PROJECT_BINARY_DIR}/sixpoint-config.cmake INSTALL_DESTINATION ${sixpoint_package_folder})
# Before version 1 a minor version may change the interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/sixpoint-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/sixpoint-config.cmake
  ${PROJECT_BINARY_DIR}/sixpoint-config-version.cmake
  DESTINATION ${sixpoint_package_folder} COMPONENT mocks)

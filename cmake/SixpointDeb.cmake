# The Debian packages (packaging/README.md): cpack -G DEB, or scripts/package.sh.
# Components: `program`, which `cmake --install` also installs anywhere; `deb` and `station`, what has
# its place on a Debian system and nowhere else; `dev` and `mocks` (SixpointPackage.cmake).
set(reference ${PROJECT_BINARY_DIR}/packaging)
file(MAKE_DIRECTORY ${reference})

add_executable(sixpoint_reference ${PROJECT_SOURCE_DIR}/packaging/reference.cpp)
target_link_libraries(sixpoint_reference PRIVATE sixpoint::cli_program fmt::fmt sixpoint_warnings)
configure_file(packaging/man/sixpoint.1.in ${reference}/sixpoint.1.in @ONLY)
configure_file(packaging/deb/changelog.in ${reference}/changelog @ONLY)
# Packed without a time stamp: the same sources give the same package.
add_custom_command(OUTPUT ${reference}/sixpoint.1.gz ${reference}/sixpoint.bash ${reference}/changelog.gz
  COMMAND sixpoint_reference man ${reference}/sixpoint.1.in > ${reference}/sixpoint.1
  COMMAND gzip -9nkf ${reference}/sixpoint.1
  COMMAND sixpoint_reference completion ${PROJECT_SOURCE_DIR}/packaging/bash/sixpoint.in
          > ${reference}/sixpoint.bash
  COMMAND gzip -9nkf ${reference}/changelog
  DEPENDS sixpoint_reference ${reference}/sixpoint.1.in ${reference}/changelog
          ${PROJECT_SOURCE_DIR}/packaging/bash/sixpoint.in VERBATIM)
# What it is made of, by the packages of a Debian system.
set(sbom "")
find_program(SIXPOINT_DPKG_QUERY dpkg-query)
if(SIXPOINT_DPKG_QUERY AND NOT SIXPOINT_SANITIZE AND NOT SIXPOINT_FUZZ)
  set(sbom ${reference}/sbom.cdx.json)
  get_property(parts GLOBAL PROPERTY SIXPOINT_PARTS)
  list(TRANSFORM parts REPLACE "(.+)" "$<TARGET_FILE:\\1>" OUTPUT_VARIABLE part_files)
  add_custom_command(OUTPUT ${sbom}
    COMMAND ${PROJECT_SOURCE_DIR}/packaging/sbom.sh ${PROJECT_SOURCE_DIR} ${PROJECT_VERSION}
            $<TARGET_FILE:sixpoint> ${part_files} > ${sbom}
    DEPENDS sixpoint ${parts} ${PROJECT_SOURCE_DIR}/packaging/sbom.sh
            ${PROJECT_SOURCE_DIR}/station/web/package-lock.json VERBATIM)
endif()
add_custom_target(sixpoint_package_files ALL
  DEPENDS ${reference}/sixpoint.1.gz ${reference}/sixpoint.bash ${reference}/changelog.gz ${sbom})

install(FILES ${reference}/sixpoint.1.gz DESTINATION share/man/man1 COMPONENT program)
install(FILES ${reference}/sixpoint.bash DESTINATION share/bash-completion/completions RENAME sixpoint
        COMPONENT program)
set(deb COMPONENT deb EXCLUDE_FROM_ALL)
install(FILES ${sbom} README.md DESTINATION share/doc/sixpoint ${deb})
install(DIRECTORY docs/ DESTINATION share/doc/sixpoint/docs ${deb} FILES_MATCHING PATTERN "*.md")
install(FILES packaging/udev/60-sixpoint-detect.rules packaging/udev/70-sixpoint-access.rules
        DESTINATION /lib/udev/rules.d ${deb})
set(station COMPONENT station EXCLUDE_FROM_ALL)
install(FILES packaging/udev/71-sixpoint-service.rules DESTINATION /lib/udev/rules.d ${station})
install(FILES packaging/systemd/sixpoint-station.service DESTINATION /lib/systemd/system ${station})
install(FILES packaging/systemd/sixpoint-station.default DESTINATION /etc/default
        RENAME sixpoint-station ${station})

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_VENDOR "The Sixpoint authors")
set(CPACK_PACKAGE_CONTACT "The Sixpoint authors <sixpoint@packages.invalid>")
set(CPACK_PACKAGE_DIRECTORY ${PROJECT_BINARY_DIR}/package)
# One package for each group of components (cpack_add_component, below).
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)
set(CPACK_COMPONENTS_ALL program deb station dev mocks)
set(CPACK_INSTALL_CMAKE_PROJECTS "${PROJECT_BINARY_DIR};sixpoint;ALL;/")
# Absolute destinations (/lib, /etc) go into the package, not onto this machine.
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
# What is built is packed; packing builds nothing.
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each package has its own first line
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

# sixpoint_deb(GROUP NAME SECTION DEPENDS SUMMARY TEXT): what dpkg says of one package.
macro(sixpoint_deb GROUP NAME SECTION DEPENDS SUMMARY TEXT)
  set(CPACK_DEBIAN_${GROUP}_PACKAGE_NAME ${NAME})
  set(CPACK_DEBIAN_${GROUP}_PACKAGE_SECTION ${SECTION})
  set(CPACK_DEBIAN_${GROUP}_PACKAGE_DEPENDS "${DEPENDS}")
  set(CPACK_DEBIAN_${GROUP}_DESCRIPTION "${SUMMARY}\n${TEXT}")
endmacro()
sixpoint_deb(MAIN sixpoint science
  "fonts-dejavu-core"  # the fonts of the certificate
  "calibrate activity monitors and repair their recordings"
"Activity monitors of the kind wGT3X-BT that were calibrated before 2014-03-24
and later run by firmware 1.4.0 to 1.7.0 wrote recordings that are wrong by
100 mg and more. Sixpoint measures the right constants on a six-orientation
jig, in a calibration file or in the recordings themselves, finds the affected
files, and repairs them without touching the originals.")
set(CPACK_DEBIAN_MAIN_PACKAGE_RECOMMENDS "udev")
set(same_version "(= ${PROJECT_VERSION})")
sixpoint_deb(STATION sixpoint-station science "sixpoint ${same_version}"
  "technician's page for calibrating activity monitors, as a service"
"The page of 'sixpoint station' on the loopback address of this machine, started
by systemd without a user of its own, with access to the units and jigs alone.
It does not start by itself: name its devices in /etc/default/sixpoint-station.")
set(CPACK_DEBIAN_STATION_PACKAGE_ARCHITECTURE all)
set(station_control_files conffiles postinst prerm postrm)
list(TRANSFORM station_control_files PREPEND ${PROJECT_SOURCE_DIR}/packaging/deb/ OUTPUT_VARIABLE
     CPACK_DEBIAN_STATION_PACKAGE_CONTROL_EXTRA)
sixpoint_deb(DEV libsixpoint-dev libdevel
  "libdeflate-dev, libeigen3-dev, libfmt-dev, libhidapi-dev, libisal-dev, libssl-dev, \
libexpected-dev, libudev-dev, libusb-1.0-0-dev, libzip-dev, nlohmann-json3-dev, pkg-config, zlib1g-dev"
  "read and calibrate recordings of activity monitors from C++"
"Static libraries, headers and a CMake package: recordings (.gt3x, .agdc),
six-point calibration, simulation of the sensor, access to the units.")
sixpoint_deb(MOCKS libsixpoint-mocks-dev libdevel "libsixpoint-dev ${same_version}"
  "activity monitors that are not there, for tests of C++ programs"
"Virtual units and jigs with faults that come when a test wants them, as a link
in the process and as a USB device; inert mocks that record their calls.")
foreach(package sixpoint-station:station libsixpoint-dev:dev libsixpoint-mocks-dev:mocks sixpoint:deb)
  string(REPLACE ":" ";" package ${package})
  list(GET package 0 name)
  list(GET package 1 component)
  install(FILES packaging/deb/copyright ${reference}/changelog.gz DESTINATION share/doc/${name}
          COMPONENT ${component} EXCLUDE_FROM_ALL)
endforeach()
include(CPack)
cpack_add_component(program GROUP main)
cpack_add_component(deb GROUP main)
foreach(component station dev mocks)
  cpack_add_component(${component} GROUP ${component})
endforeach()
foreach(group main station dev mocks)
  cpack_add_component_group(${group})
endforeach()

# Read by cpack when it begins: without dpkg-shlibdeps it would make a package that depends on no library.
foreach(tool dpkg-shlibdeps file)
  find_program(${tool}_path ${tool})
  if(NOT ${tool}_path)
    message(FATAL_ERROR "making Debian packages needs ${tool}, which is not here; this installs it: deploy/setup test")
  endif()
endforeach()

program main
  use pd_scene_types, only: scene_type
  implicit none (type, external)
  type(scene_type) :: scene
  print *, scene%horizon%ratio
end program main

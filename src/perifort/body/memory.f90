!> Whether a scene fits into the memory, before any of its points is made.
module pd_body_memory
  use pd_base_kinds, only: wp, i8
  use pd_base_error, only: error_type
  use pd_base_system, only: available_memory
  use pd_base_text, only: to_text, with_unit
  use pd_scene_check_bodies, only: memory_per_point
  use pd_scene_rules, only: scene_fault
  use pd_scene_types, only: scene_type, is_set
  use pd_body_generate, only: horizon_of
  implicit none (type, external)
  private
  public :: check_memory, any_critical

contains

  !> An error if the lattice bodies of a scene need more memory than there is, at the body with the
  !> most points. Measured on cubes, a list takes about 10 bytes a bond, a lattice whose bonds can
  !> break has a bit for each, and conjugate gradients take up to 250 bytes a point.
  subroutine check_memory(scene, error)
    type(scene_type), intent(in) :: scene
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: per_bond = 10.0_wp, per_bit = 0.125_wp, per_solver = 250.0_wp
    real(wp) :: points, most, number, spacing, members, need, there
    integer :: i, dim, largest

    dim = scene%header%dimension
    points = 0.0_wp
    most = 0.0_wp
    spacing = 0.0_wp
    largest = 1
    do i = 1, size(scene%bodies)
      if (scene%bodies(i)%file /= '') cycle
      number = product(real(scene%bodies(i)%points(:dim), wp))
      points = points + number
      if (number > most) largest = i
      most = max(most, number)
      spacing = max(spacing, (scene%bodies(i)%upper(1) - scene%bodies(i)%lower(1)) &
        & /scene%bodies(i)%points(1))
    end do
    if (points <= 0.0_wp) return
    need = points*memory_per_point
    if (scene%time%method == 'relaxation' .and. scene%relaxation%solver == 'conjugate_gradient') &
      & need = need + points*per_solver
    members = min(points, (2*min(horizon_of(scene, spacing)/spacing, points))**dim)
    if (scene%horizon%family == 'list' .or. any(scene%bodies%file /= '')) then
      need = need + points*per_bond*members
    else if (size(scene%cracks) > 0 .or. any_critical(scene)) then
      need = need + points*per_bit*members
    end if
    there = real(available_memory(), wp)
    if (need <= there) return
    call scene_fault(error, scene, 'body', largest, 'points', 'the scene has '// &
      & to_text(int(points, i8))//' points and needs about '//with_unit(need, 'B', 3)// &
      & ' of memory', 'only '//with_unit(there, 'B', 3)//' are available')
  end subroutine check_memory

  !> Whether some material of the scene can fail.
  pure logical function any_critical(scene)
    type(scene_type), intent(in) :: scene
    any_critical = any(is_set(scene%materials%critical_stretch)) .or. &
      & any(is_set(scene%materials%critical_energy_release_rate))
  end function any_critical

end module pd_body_memory

!> Scenes to start from, with every key explained.
!>
!> They are built from numbers and printed by the same declarations that read scenes, so they always
!> agree with the reader.
module pd_scene_content_template
  use pd_base_kinds, only: wp
  use pd_base_error, only: error_type, fail, status_usage
  use pd_base_text, only: join, nearest_name, newline
  use pd_scene_content_check, only: allocate_groups
  use pd_scene_content_types, only: scene_type
  use pd_scene_groups_header, only: own_defaults
  use pd_scene_content_write, only: commented_text
  implicit none (type, external)
  private
  public :: write_template, template_text, template_names

  character(10), parameter :: template_names(5) = [character(10) :: 'bar', 'plate', 'block', &
    & 'crack', 'relaxation']  !! what `write_template` knows

contains

  !> Write the template `name`, the first one if it is ''. An error if there is no such template.
  subroutine write_template(unit, name, error, fields)
    integer, intent(in) :: unit                      !! open for formatted writing
    character(*), intent(in) :: name                 !! one of `template_names`, or ''
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: fields(:)  !! names of the fields of the output
    character(:), allocatable :: text

    if (present(fields)) then
      call template_text(name, text, error, fields)
    else
      call template_text(name, text, error)
    end if
    if (allocated(error)) return
    write (unit, '(a)', advance='no') text
  end subroutine write_template

  !> The text of the template `name`, as `write_template` prints it.
  subroutine template_text(name, text, error, fields)
    character(*), intent(in) :: name                 !! one of `template_names`, or ''
    character(:), allocatable, intent(out) :: text   !! a scene file; '' on an error
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: fields(:)  !! names of the fields of the output
    type(scene_type) :: scene
    character(:), allocatable :: nearest, note, groups

    text = ''
    select case (name)
    case ('', 'bar')
      call bar(scene)
    case ('plate')
      call plate(scene)
    case ('block')
      call block_in_tension(scene)
    case ('crack')
      call crack(scene)
    case ('relaxation')
      call relaxation(scene)
    case default
      nearest = nearest_name(name, template_names)
      note = ''
      if (len(nearest) > 0) note = " did you mean '"//nearest//"'? "
      call fail(error, "no template is named '"//name//"';"//note//' known: '// &
        & join(template_names, ', '), status_usage)
      return
    end select
    ! with this key a scene keeps its defaults in all later versions
    scene%header%defaults = own_defaults
    if (present(fields)) then
      groups = commented_text(scene, fields)
    else
      groups = commented_text(scene)
    end if
    text = '! '//trim(scene%header%title)//newline// &
      & "! Values are in SI units. Keys behind a '!' are at the default that is shown, or not "// &
      & 'needed.'//newline// &
      & '! Templates: '//join(template_names, ', ')//newline//newline//groups
  end subroutine template_text

  !> 1D: a stretched bar, fixed at one end, let go.
  subroutine bar(scene)
    type(scene_type), intent(out) :: scene

    allocate (scene%bodies(1), scene%materials(1), scene%initial(1), scene%boundaries(1), &
      & scene%probes(1))
    call allocate_groups(scene)
    call steel(scene)
    scene%header%title = 'Longitudinal vibration of a bar'
    scene%header%dimension = 1
    scene%header%area = 1.0e-6_wp
    scene%bodies(1)%name = 'bar'
    scene%bodies(1)%lower(1) = 0.0_wp
    scene%bodies(1)%upper(1) = 1.0_wp
    scene%bodies(1)%points(1) = 1000
    scene%initial(1)%displacement_gradient(1, 1) = 0.001_wp
    scene%boundaries(1)%name = 'wall'
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement(1) = 0.0_wp
    scene%time%duration = 1.0e-3_wp
    scene%output%every = 500
    scene%probes(1)%name = 'centre'
    scene%probes(1)%point(1) = 0.5_wp
  end subroutine bar

  !> 2D: a plate pulled at both ends, in static equilibrium.
  subroutine plate(scene)
    type(scene_type), intent(out) :: scene

    allocate (scene%bodies(1), scene%materials(1), scene%loads(2), scene%probes(1))
    call allocate_groups(scene)
    call steel(scene)
    scene%header%title = 'Plate in tension'
    scene%header%dimension = 2
    scene%header%thickness = 0.01_wp
    scene%bodies(1)%name = 'plate'
    scene%bodies(1)%lower(:2) = [-0.5_wp, -0.25_wp]
    scene%bodies(1)%upper(:2) = [0.5_wp, 0.25_wp]
    scene%bodies(1)%points(:2) = [50, 25]
    scene%materials(1)%poissons_ratio = 0.3_wp
    scene%loads(1)%side = 'x_min'
    scene%loads(1)%pressure = -200.0e6_wp
    scene%loads(2)%side = 'x_max'
    scene%loads(2)%pressure = -200.0e6_wp
    scene%time%method = 'relaxation'
    scene%probes(1)%name = 'quarter'
    scene%probes(1)%point(:2) = [0.25_wp, 0.0_wp]
  end subroutine plate

  !> 3D: a block held at one end and pulled at the other, in static equilibrium.
  subroutine block_in_tension(scene)
    type(scene_type), intent(out) :: scene

    allocate (scene%bodies(1), scene%materials(1), scene%boundaries(1), scene%loads(1), &
      & scene%probes(1))
    call allocate_groups(scene)
    call steel(scene)
    scene%header%title = 'Block in tension'
    scene%header%dimension = 3
    scene%bodies(1)%name = 'block'
    scene%bodies(1)%lower = [0.0_wp, -0.05_wp, -0.05_wp]
    scene%bodies(1)%upper = [0.5_wp, 0.05_wp, 0.05_wp]
    scene%bodies(1)%points = [30, 6, 6]
    scene%materials(1)%poissons_ratio = 0.3_wp
    scene%boundaries(1)%name = 'clamp'
    scene%boundaries(1)%side = 'x_min'
    scene%boundaries(1)%displacement = 0.0_wp
    scene%loads(1)%side = 'x_max'
    scene%loads(1)%pressure = -200.0e6_wp
    scene%time%method = 'relaxation'
    scene%probes(1)%name = 'end'
    scene%probes(1)%point = [0.5_wp, 0.0_wp, 0.0_wp]
  end subroutine block_in_tension

  !> 2D: a plate with a crack in its middle, pulled apart until the crack runs.
  subroutine crack(scene)
    type(scene_type), intent(out) :: scene

    allocate (scene%bodies(1), scene%materials(1), scene%cracks(1), scene%no_fail(2), &
      & scene%boundaries(2))
    call allocate_groups(scene)
    call brittle(scene)
    scene%header%title = 'Plate with a crack, pulled at 20 m/s'
    scene%cracks(1)%from(:2) = [-0.005_wp, 0.0_wp]
    scene%cracks(1)%to(:2) = [0.005_wp, 0.0_wp]
    scene%no_fail(1)%shape = 'box'
    scene%no_fail(1)%lower(2) = 0.0125_wp
    scene%no_fail(2)%shape = 'box'
    scene%no_fail(2)%upper(2) = -0.0125_wp
    scene%boundaries(1)%name = 'top'
    scene%boundaries(1)%side = 'y_max'
    scene%boundaries(1)%velocity(2) = 20.0_wp
    scene%boundaries(2)%name = 'bottom'
    scene%boundaries(2)%side = 'y_min'
    scene%boundaries(2)%velocity(2) = -20.0_wp
    scene%materials(1)%critical_stretch = 0.04472_wp
    scene%time%duration = 24.0e-6_wp
    scene%output%interval = 2.0e-6_wp
  end subroutine crack

  !> 2D: a plate with a hole, stretched slowly until it cracks.
  subroutine relaxation(scene)
    type(scene_type), intent(out) :: scene

    allocate (scene%bodies(1), scene%materials(1), scene%removed(1), scene%boundaries(2))
    call allocate_groups(scene)
    call brittle(scene)
    scene%header%title = 'Plate with a hole, stretched slowly'
    scene%bodies(1)%points(:2) = [40, 40]
    scene%removed(1)%shape = 'sphere'
    scene%removed(1)%radius = 0.005_wp
    scene%boundaries(1)%name = 'top'
    scene%boundaries(1)%side = 'y_max'
    scene%boundaries(1)%displacement(2) = 2.7541e-4_wp
    scene%boundaries(2)%name = 'bottom'
    scene%boundaries(2)%side = 'y_min'
    scene%boundaries(2)%displacement(2) = -2.7541e-4_wp
    scene%materials(1)%critical_stretch = 0.02_wp
    scene%time%method = 'relaxation'
    scene%relaxation%load_steps = 10
    scene%output%every = 1
  end subroutine relaxation

  !> A material that does not break.
  subroutine steel(scene)
    type(scene_type), intent(inout) :: scene

    scene%materials(1)%name = 'steel'
    scene%materials(1)%youngs_modulus = 200.0e9_wp
    scene%materials(1)%density = 7850.0_wp
  end subroutine steel

  !> A square plate of a brittle material with the bond-based model.
  subroutine brittle(scene)
    type(scene_type), intent(inout) :: scene

    scene%header%dimension = 2
    scene%header%thickness = 1.0e-3_wp
    scene%bodies(1)%name = 'plate'
    scene%bodies(1)%lower(:2) = -0.025_wp
    scene%bodies(1)%upper(:2) = 0.025_wp
    scene%bodies(1)%points(:2) = [100, 100]
    scene%materials(1)%name = 'brittle'
    scene%materials(1)%model = 'bond_based'
    scene%materials(1)%youngs_modulus = 192.0e9_wp
    scene%materials(1)%density = 8000.0_wp
  end subroutine brittle

end module pd_scene_content_template

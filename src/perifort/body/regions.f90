!> Regions and expressions of a scene on the points of its bodies.
module pd_body_regions
  use pd_base_error, only: error_type, internal_fault
  use pd_base_field, only: field_type, field_values
  use pd_base_kinds, only: wp, i4
  use pd_body_body, only: body_type
  use pd_body_choice, only: field_on, inside_file, values_on
  use pd_body_meshes, only: check_set, names_set, set_mask
  use pd_body_shapes, only: inside, touch
  use pd_scene_content_types, only: scene_type, shape_group, is_of_file
  implicit none (type, external)
  private
  public :: check_regions, in_region, in_shape, region_mask

contains

  !> An error is set if the expression of a region has no finite value at a point of the bodies, if
  !> a name of a mesh or surface means no points or facets, or if the file of a region cannot be
  !> read.
  subroutine check_regions(scene, body, error)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, layers included
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: values(:)
    integer(i4), allocatable :: slots(:)
    integer :: r, k

    call check_sets(scene, body, error)
    if (allocated(error)) return
    slots = pack([(int(k, i4), k=1, body%n_slots)], body%point > 0)
    do r = 1, size(scene%no_fail)
      call try_file(scene, scene%no_fail(r), 'no_fail', r, error)
      if (allocated(error)) return
    end do
    do r = 1, size(scene%regions)
      call try_file(scene, scene%regions(r), 'region', r, error)
      if (allocated(error)) return
      if (scene%regions(r)%where == '') cycle
      call values_on(scene, scene%regions(r)%where, body, slots, 'region', r, 'where', values, &
        & error)
      if (allocated(error)) return
    end do
  end subroutine check_regions

  !> Read the surface or mesh of a shape, if it has one, for its errors.
  subroutine try_file(scene, shape, group, number, error)
    type(scene_type), intent(in) :: scene
    class(shape_group), intent(in) :: shape
    character(*), intent(in) :: group
    integer, intent(in) :: number
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: nowhere(0, 3)
    logical, allocatable :: inside_it(:)

    if (is_of_file(shape)) call inside_file(scene, shape, nowhere, 1.0_wp, group, number, &
      & inside_it, error)
  end subroutine try_file

  !> The slots with points in a shape, or inside of its surface or mesh.
  function in_shape(scene, body, shape) result(mask)
    type(scene_type), intent(in) :: scene     !! a checked scene
    type(body_type), intent(in) :: body       !! its points, arranged in slots
    class(shape_group), intent(in) :: shape   !! a group of it, whose file can be read
    logical, allocatable :: mask(:)
    type(error_type), allocatable :: error

    if (is_of_file(shape)) then
      call inside_file(scene, shape, body%x, minval(body%spacing, mask=body%point > 0), '', 0, &
        & mask, error)
      if (allocated(error)) call internal_fault('a file that could be read')
    else
      mask = inside(shape, body%x, touch*minval(body%spacing, mask=body%point > 0))
    end if
    mask = mask .and. body%point > 0
  end function in_shape

  !> Names of meshes in all groups that may have them.
  subroutine check_sets(scene, body, error)
    type(scene_type), intent(in) :: scene
    type(body_type), intent(in) :: body
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    do i = 1, size(scene%initial)
      call check_set(scene, body, scene%initial(i)%region, .false., 'initial', i, 'region', error)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%boundaries)
      call check_set(scene, body, scene%boundaries(i)%region, .false., 'boundary', i, 'region', &
        & error)
      if (.not. allocated(error)) call check_set(scene, body, scene%boundaries(i)%side, .true., &
        & 'boundary', i, 'side', error)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%loads)
      call check_set(scene, body, scene%loads(i)%region, .false., 'load', i, 'region', error)
      if (.not. allocated(error)) call check_set(scene, body, scene%loads(i)%side, .true., &
        & 'load', i, 'side', error)
      if (allocated(error)) return
    end do
    do i = 1, size(scene%no_fail)
      call check_set(scene, body, scene%no_fail(i)%region, .false., 'no_fail', i, 'region', error)
      if (allocated(error)) return
    end do
    if (.not. allocated(scene%studies)) return
    do i = 1, size(scene%studies)
      call check_set(scene, body, scene%studies(i)%region, .false., 'study', i, 'region', error)
      if (allocated(error)) return
    end do
  end subroutine check_sets

  !> The slots with points in a region or in a set of a mesh, by name. No slot is in one that is not
  !> there.
  function region_mask(scene, body, name) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, layers included, arranged in slots
    character(*), intent(in) :: name       !! of a `&region`, or `BODY:NAME`
    logical, allocatable :: mask(:)
    integer :: r

    if (names_set(name)) then
      mask = set_mask(scene, body, name)
      return
    end if
    allocate (mask(body%n_slots), source=.false.)
    do r = 1, size(scene%regions)
      if (scene%regions(r)%name /= name) cycle
      mask = in_region(scene, body, r)
    end do
  end function region_mask

  !> The slots with points in a region: inside its shape, and where its expression is not 0.
  function in_region(scene, body, number) result(mask)
    type(scene_type), intent(in) :: scene  !! a checked scene
    type(body_type), intent(in) :: body    !! its points, arranged in slots
    integer, intent(in) :: number          !! of the `&region`
    logical, allocatable :: mask(:)
    type(field_type) :: field
    real(wp), allocatable :: values(:)
    integer(i4), allocatable :: slots(:)
    integer :: k, at

    associate (region => scene%regions(number))
      mask = body%point > 0
      if (region%shape /= '' .or. is_of_file(region) .or. region%where == '') &
        & mask = in_shape(scene, body, region)
      if (region%where == '') return
      slots = pack([(int(k, i4), k=1, body%n_slots)], mask)
      call field_on(scene, region%where, body, slots, field)
      allocate (values(size(slots)))
      call field_values(field, 0.0_wp, values, at)
      ! check_regions refuses what is not finite
      mask(slots) = abs(values) > 0.0_wp
    end associate
  end function in_region

end module pd_body_regions

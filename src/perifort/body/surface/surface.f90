!> Surfaces as read from a file: facets with their corners, and the solids that they belong to.
module pd_body_surface_surface
  use pd_base_error, only: error_type, fail
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_lookup, only: lookup_type, mix
  use pd_base_text, only: newline, to_text
  use pd_base_vectors, only: cross
  use pd_scene_format_given, only: name_length
  implicit none (type, external)
  private
  public :: surface_type, add_facet, finish_surface, weld_vertices, corners_of, area_vector, &
    & centre_of, of_single, surface_fault, place_of_facet, extent_text

  real(wp), parameter :: of_single = 2.4e-7_wp   !! rounding of single precision, over a length

  type :: surface_type
    character(:), allocatable :: file           !! where it was read from, for messages
    integer :: n_facets = 0
    integer :: n_vertices = 0
    real(wp), allocatable :: x(:, :)            !! (3, n_vertices or more) positions [m]
    integer(i4), allocatable :: corner(:, :)    !! (3, n_facets or more) vertices of each facet
    integer(i4), allocatable :: solid(:)        !! (n_facets or more) number of its solid
    integer(i4), allocatable :: number(:)       !! (n_facets or more) number in the file, from 1
    integer(i4), allocatable :: line(:)         !! (n_facets or more) line of the file; 0: binary
    integer :: n_solids = 0
    character(name_length), allocatable :: names(:)  !! (n_solids or more) of the solids
    integer :: n_flat = 0                       !! facets without area
    integer :: first_flat = 0                   !! number of the first one in the file
    integer :: line_flat = 0                    !! its line; 0: binary
    real(wp) :: low(3) = 0.0_wp                 !! corners of the box around it [m]
    real(wp) :: high(3) = 0.0_wp
    real(wp) :: volume = 0.0_wp                 !! inside of it, by the theorem of Gauss [m3]
    type(lookup_type), private :: vertices      !! numbers of vertices by their places
  end type surface_type

contains

  !> Add a facet. Vertices at the same place are one; a facet with two such corners is counted, not
  !> added: its edges cancel each other.
  subroutine add_facet(surface, corners, solid, number, line)
    type(surface_type), intent(inout) :: surface  !! has one facet more, unless two corners are one
    real(wp), intent(in) :: corners(3, 3)         !! a corner in each column [m]
    integer, intent(in) :: solid                  !! number of its solid
    integer, intent(in) :: number                 !! of the facet in the file, from 1
    integer, intent(in) :: line                   !! of the file; 0 if it has none
    integer(i4), allocatable :: longer(:, :)
    integer :: at(3), i

    if (.not. allocated(surface%corner)) then
      allocate (surface%corner(3, 1024), surface%solid(1024), surface%number(1024), &
        & surface%line(1024), surface%x(3, 1024))
    end if
    do i = 1, 3
      call number_of_vertex(surface, corners(:, i), at(i))
    end do
    if (at(1) == at(2) .or. at(2) == at(3) .or. at(3) == at(1)) then
      call count_flat(surface, number, line)
      return
    end if
    if (surface%n_facets == size(surface%solid)) then
      allocate (longer(3, 2*surface%n_facets))
      longer(:, :surface%n_facets) = surface%corner
      call move_alloc(longer, surface%corner)
      surface%solid = [surface%solid, surface%solid]
      surface%number = [surface%number, surface%number]
      surface%line = [surface%line, surface%line]
    end if
    surface%n_facets = surface%n_facets + 1
    surface%corner(:, surface%n_facets) = int(at, i4)
    surface%solid(surface%n_facets) = int(solid, i4)
    surface%number(surface%n_facets) = int(number, i4)
    surface%line(surface%n_facets) = int(line, i4)
  end subroutine add_facet

  !> Count a facet without area.
  pure subroutine count_flat(surface, number, line)
    type(surface_type), intent(inout) :: surface
    integer, intent(in) :: number, line

    surface%n_flat = surface%n_flat + 1
    if (surface%n_flat > 1) return
    surface%first_flat = number
    surface%line_flat = line
  end subroutine count_flat

  !> The number of the vertex at a place; a new one is added.
  subroutine number_of_vertex(surface, place, number)
    type(surface_type), intent(inout) :: surface
    real(wp), intent(in) :: place(3)
    integer, intent(out) :: number
    real(wp), allocatable :: longer(:, :)
    real(wp) :: x(3)
    integer(i8) :: bits(3)
    logical :: is_new

    x = place
    where (abs(x) <= 0.0_wp) x = 0.0_wp  ! -0 is 0
    bits = transfer(x, bits)
    call surface%vertices%number_of(mix(mix(mix(0_i8, bits(1)), bits(2)), bits(3)), number, is_new)
    if (.not. is_new) then
      if (all(transfer(surface%x(:, number), bits) == bits)) return
      ! two places may have one key, if hardly ever: the later one is then of its own
      call surface%vertices%own_number(number)
    end if
    if (number > size(surface%x, 2)) then
      allocate (longer(3, 2*number))
      longer(:, :surface%n_vertices) = surface%x(:, :surface%n_vertices)
      call move_alloc(longer, surface%x)
    end if
    surface%x(:, number) = x
    surface%n_vertices = number
  end subroutine number_of_vertex

  !> What follows of all facets: box and volume; and how many have no area though their corners
  !> differ. These stay: they close the surface between others.
  subroutine finish_surface(surface)
    type(surface_type), intent(inout) :: surface  !! with all its facets
    real(wp), parameter :: flat = 1.0e-10_wp      !! height over length of what has no area
    real(wp) :: x(3, 3), middle(3), longest
    integer :: f, c

    surface%vertices = lookup_type()
    do c = 1, 3
      surface%low(c) = minval(surface%x(c, :surface%n_vertices))
      surface%high(c) = maxval(surface%x(c, :surface%n_vertices))
    end do
    middle = (surface%low + surface%high)/2
    surface%volume = 0.0_wp
    do f = 1, surface%n_facets
      x = corners_of(surface, f)
      longest = max(sum((x(:, 2) - x(:, 1))**2), sum((x(:, 3) - x(:, 2))**2), &
        & sum((x(:, 1) - x(:, 3))**2))
      if (norm2(area_vector(surface, f)) <= flat*longest) call count_flat(surface, &
        & int(surface%number(f)), int(surface%line(f)))
      surface%volume = surface%volume + dot_product(x(:, 1) - middle, area_vector(surface, f))/3
    end do
  end subroutine finish_surface

  !> Make vertices one that differ by the rounding of single precision, as -8.7e-8 and 0 do. Facets
  !> that have two such corners are left out: their edges cancel each other.
  subroutine weld_vertices(surface, welded)
    type(surface_type), intent(inout) :: surface  !! finished
    integer, intent(out) :: welded                !! vertices that became others
    real(wp), parameter :: cell = 16.0_wp         !! edge of the cells that vertices are sought in
    type(lookup_type) :: cells
    integer(i4), allocatable :: first(:), next(:), becomes(:)
    integer(i8) :: low(3), high(3), i, j, k
    integer :: v, number, f, n
    integer(i4) :: other, at(3)
    real(wp) :: near
    logical :: is_new

    near = of_single*max(maxval(abs(surface%low)), maxval(abs(surface%high)))
    allocate (first(surface%n_vertices), next(surface%n_vertices), source=0_i4)
    becomes = [(int(v, i4), v=1, surface%n_vertices)]
    do v = 1, surface%n_vertices
      low = floor((surface%x(:, v) - near)/(cell*near), i8)
      high = floor((surface%x(:, v) + near)/(cell*near), i8)
      do k = low(3), high(3)
        do j = low(2), high(2)
          do i = low(1), high(1)
            number = cells%look(mix(mix(mix(0_i8, i), j), k))
            if (number == 0) cycle
            other = first(number)
            do while (other > 0_i4)
              if (all(abs(surface%x(:, v) - surface%x(:, other)) <= near)) becomes(v) = other
              other = next(other)
            end do
          end do
        end do
      end do
      if (becomes(v) /= v) cycle
      low = floor(surface%x(:, v)/(cell*near), i8)
      call cells%number_of(mix(mix(mix(0_i8, low(1)), low(2)), low(3)), number, is_new)
      next(v) = first(number)
      first(number) = int(v, i4)
    end do
    welded = count([(becomes(v) /= v, v=1, surface%n_vertices)])
    if (welded == 0) return
    n = 0
    do f = 1, surface%n_facets
      at = becomes(surface%corner(:, f))
      if (at(1) == at(2) .or. at(2) == at(3) .or. at(3) == at(1)) cycle
      n = n + 1
      surface%corner(:, n) = at
      surface%solid(n) = surface%solid(f)
      surface%number(n) = surface%number(f)
      surface%line(n) = surface%line(f)
    end do
    surface%n_facets = n
  end subroutine weld_vertices

  !> The corners of a facet, each in a column [m].
  pure function corners_of(surface, facet) result(x)
    type(surface_type), intent(in) :: surface  !! the surface
    integer, intent(in) :: facet               !! its number, from 1
    real(wp) :: x(3, 3)
    x = surface%x(:, surface%corner(:, facet))
  end function corners_of

  !> The area of a facet along its outward normal, which sees the corners turn to the left [m2].
  pure function area_vector(surface, facet) result(vector)
    type(surface_type), intent(in) :: surface  !! the surface
    integer, intent(in) :: facet               !! its number, from 1
    real(wp) :: vector(3)

    associate (x => surface%x, at => surface%corner(:, facet))
      vector = cross(x(:, at(2)) - x(:, at(1)), x(:, at(3)) - x(:, at(1)))/2
    end associate
  end function area_vector

  !> The centre of a facet [m].
  pure function centre_of(surface, facet) result(centre)
    type(surface_type), intent(in) :: surface  !! the surface
    integer, intent(in) :: facet               !! its number, from 1
    real(wp) :: centre(3)
    centre = sum(surface%x(:, surface%corner(:, facet)), dim=2)/3
  end function centre_of

  !> An error at a facet, or at the file.
  pure subroutine surface_fault(surface, message, error, note, facet)
    type(surface_type), intent(in) :: surface      !! its file is the place
    character(*), intent(in) :: message            !! what is wrong
    type(error_type), allocatable, intent(out) :: error
    character(*), intent(in), optional :: note     !! what to do; none if absent
    integer, intent(in), optional :: facet         !! its number, from 1; none if absent
    character(:), allocatable :: text

    text = message//newline//' --> '//surface%file
    if (present(facet)) text = message//newline//' --> '//place_of_facet(surface%file, &
      & int(surface%number(facet)), int(surface%line(facet)))
    if (present(note)) text = text//newline//'  = '//note
    call fail(error, text)
  end subroutine surface_fault

  !> Where a facet is: `part.stl:120`, or `part.stl, facet 17` where the file has no lines.
  pure function place_of_facet(file, number, line) result(text)
    character(*), intent(in) :: file  !! the file's name
    integer, intent(in) :: number     !! of the facet in the file, from 1
    integer, intent(in) :: line       !! of the file; 0 if it has none
    character(:), allocatable :: text

    text = file//', facet '//to_text(number)
    if (line > 0) text = file//':'//to_text(line)
  end function place_of_facet

  !> The lengths of the box around a surface: `0.1 x 0.2 x 0.3 m`.
  pure function extent_text(surface) result(text)
    type(surface_type), intent(in) :: surface  !! finished
    character(:), allocatable :: text
    real(wp) :: length(3)

    length = surface%high - surface%low
    text = to_text(length(1), 4)//' x '//to_text(length(2), 4)//' x '//to_text(length(3), 4)//' m'
  end function extent_text

end module pd_body_surface_surface

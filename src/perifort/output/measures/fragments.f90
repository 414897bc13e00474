!> Fragments are parts of the body that chains of intact bonds join. How many there are and the mass
!> of the largest are columns of the history; each output has a table of all.
module pd_output_measures_fragments
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_reduce, only: sum_parts
  use pd_base_vectors, only: cross
  use pd_body_body, only: owned
  use pd_motion_static_pieces, only: find_pieces, pieces_type
  use pd_motion_system, only: inverse_density, system_type
  use pd_output_fields_field, only: moment_type
  use pd_output_measures_measure, only: measure_list_type, measure_type, row_source_type
  use pd_output_results_types, only: column_type
  use pd_scene_content_rules, only: scene_fault
  use pd_scene_content_types, only: scene_type
  implicit none (type, external)
  private
  public :: add_fragments, fragment_type, fragments_of, spin_of

  !> One fragment, at its present place.
  type :: fragment_type
    integer :: points = 0
    real(wp) :: mass = 0.0_wp            !! [kg]
    real(wp) :: centre(3) = 0.0_wp       !! of mass [m]
    real(wp) :: velocity(3) = 0.0_wp     !! of the centre [m/s]
    real(wp) :: spin(3) = 0.0_wp         !! angular velocity that has its angular momentum [rad/s]
    real(wp) :: size = 0.0_wp            !! twice the greatest distance of a point from the centre,
                                         !! and a spacing [m]
  end type fragment_type

  type, extends(measure_type) :: fragments_measure_type
    integer(i8) :: broken = -1_i8        !! bonds, when they were counted last
    integer :: number = 0                !! of fragments then
    real(wp) :: mass = 0.0_wp            !! of the largest [kg]
  contains
    procedure :: begin => begin_fragments
    procedure :: columns => columns_of_fragments
    procedure :: row => row_of_fragments
  end type fragments_measure_type

contains

  !> Count fragments if the scene asks for them.
  subroutine add_fragments(scene, measures)
    type(scene_type), intent(in) :: scene                !! a checked scene
    type(measure_list_type), intent(inout) :: measures   !! added to

    if (scene%output%fragments) call measures%add(fragments_measure_type())
  end subroutine add_fragments

  !> An error if no bond can break.
  subroutine begin_fragments(measure, scene, system, error)
    class(fragments_measure_type), intent(inout) :: measure
    type(scene_type), intent(in) :: scene
    type(system_type), intent(in) :: system
    type(error_type), allocatable, intent(out) :: error

    measure%broken = -1_i8
    if (size(system%state%damage) == 0) then
      call scene_fault(error, scene, 'output', 1, 'fragments', &
        & 'there are no fragments: no bond can break', &
        & 'expected a material with critical_stretch, or a &crack')
    end if
  end subroutine begin_fragments

  !> How many, and the mass of the largest.
  function columns_of_fragments(measure, dim) result(columns)
    class(fragments_measure_type), intent(in) :: measure
    integer, intent(in) :: dim
    type(column_type), allocatable :: columns(:)

    associate (unused_measure => measure, unused_dim => dim)
    end associate
    columns = [column_type('fragments', '1', 'run'), &
      & column_type('largest_fragment_mass', 'kg', 'run')]
  end function columns_of_fragments

  !> They are found anew where bonds have broken since the last row.
  subroutine row_of_fragments(measure, now, values)
    class(fragments_measure_type), intent(inout) :: measure
    type(row_source_type), intent(in) :: now
    real(wp), intent(out) :: values(:)
    type(pieces_type) :: pieces
    real(wp), allocatable :: masses(:, :), totals(:, :)
    integer :: i

    associate (system => now%system)
      if (system%broken /= measure%broken) then
        call find_pieces(system%body, system%family, pieces)
        measure%broken = system%broken
        measure%number = pieces%number
        allocate (masses(1, size(pieces%slots)), totals(1, pieces%number))
        do i = 1, size(pieces%slots)
          masses(1, i) = mass_at(system, pieces%slots(i))
        end do
        call sum_parts(system%body%order, pieces%start, pieces%points, &
          & system%body%point(pieces%slots), masses, totals)
        measure%mass = max(0.0_wp, maxval(totals))
      end if
    end associate
    values(:) = [real(measure%number, wp), measure%mass]
  end subroutine row_of_fragments

  !> The mass of a point [kg].
  pure real(wp) function mass_at(system, k) result(mass)
    type(system_type), intent(in) :: system
    integer(i4), intent(in) :: k  !! its slot
    mass = system%body%volume(k)/inverse_density(system%model, int(k))
  end function mass_at

  !> All fragments at an instant, in the order of their first points, as the field `fragment`
  !> numbers them; all ranks have all of them.
  subroutine fragments_of(now, fragments)
    type(moment_type), intent(in) :: now                             !! with velocities
    type(fragment_type), allocatable, intent(out) :: fragments(:)    !! (any number)
    type(pieces_type) :: pieces
    real(wp), allocatable :: terms(:, :), totals(:, :), sizes(:)
    real(wp) :: r(3), v(3), inertia(3, 3)
    integer :: i, p, c

    associate (system => now%system, body => now%system%body, dim => now%system%body%dim)
      call find_pieces(body, system%family, pieces)
      allocate (fragments(pieces%number), sizes(pieces%number))
      ! mass, first moment, momentum
      allocate (terms(7, size(pieces%slots)), totals(7, pieces%number), source=0.0_wp)
      do i = 1, size(pieces%slots)
        associate (k => pieces%slots(i))
          terms(1, i) = mass_at(system, k)
          terms(2:1 + dim, i) = terms(1, i)*(body%x(k, :) + system%state%u(k, :))
          terms(5:4 + dim, i) = terms(1, i)*now%v(k, :)
        end associate
      end do
      call sum_parts(body%order, pieces%start, pieces%points, body%point(pieces%slots), terms, &
        & totals)
      do p = 1, pieces%number
        fragments(p)%points = int(pieces%points(p))
        fragments(p)%mass = totals(1, p)
        fragments(p)%centre = totals(2:4, p)/totals(1, p)
        fragments(p)%velocity = totals(5:7, p)/totals(1, p)
      end do
      ! angular momentum and second moments about the centre
      deallocate (terms, totals)
      allocate (terms(9, size(pieces%slots)), totals(9, pieces%number))
      sizes = 0.0_wp
      do i = 1, size(pieces%slots)
        associate (k => pieces%slots(i), f => fragments(pieces%of(pieces%slots(i))))
          r = 0.0_wp
          v = 0.0_wp
          r(:dim) = body%x(k, :) + system%state%u(k, :) - f%centre(:dim)
          v(:dim) = now%v(k, :) - f%velocity(:dim)
          terms(:, i) = mass_at(system, k)*[cross(r, v), r**2, r(1)*r(2), r(2)*r(3), r(1)*r(3)]
          if (owned(body, int(k))) sizes(pieces%of(k)) = max(sizes(pieces%of(k)), &
            & 2*norm2(r) + body%spacing(k))
        end associate
      end do
      call sum_parts(body%order, pieces%start, pieces%points, body%point(pieces%slots), terms, &
        & totals)
      if (associated(body%order%ranks)) call body%order%ranks%take_largest(sizes)
    end associate
    do p = 1, pieces%number
      associate (m => totals(4:, p))
        inertia = -reshape([m(1), m(4), m(6), m(4), m(2), m(5), m(6), m(5), m(3)], [3, 3])
        do c = 1, 3
          inertia(c, c) = inertia(c, c) + m(1) + m(2) + m(3)
        end do
      end associate
      fragments(p)%spin = spin_of(totals(:3, p), inertia)
      fragments(p)%size = sizes(p)
    end do
  end subroutine fragments_of

  !> The angular velocity that gives mass points of such inertia their angular momentum; 0 of a
  !> single point, and about the line of points that stand in one line.
  pure function spin_of(momentum, inertia) result(spin)
    real(wp), intent(in) :: momentum(3)    !! about the centre of mass [kg m2/s]
    real(wp), intent(in) :: inertia(3, 3)  !! about the centre of mass [kg m2]
    real(wp) :: spin(3)                    !! [rad/s]
    real(wp), parameter :: thin = 1.0e-9_wp  ! least of the moments over the largest
    real(wp) :: a(3, 3), trace, determinant
    integer :: c, d, e

    spin = 0.0_wp
    trace = inertia(1, 1) + inertia(2, 2) + inertia(3, 3)
    if (.not. trace > 0.0_wp) return
    a = inertia/trace
    determinant = dot_product(a(:, 1), cross(a(:, 2), a(:, 3)))
    ! of points in one line one moment is 0 and the others are half the trace
    if (determinant <= thin) then
      spin = momentum/(0.5_wp*trace)
      return
    end if
    do c = 1, 3
      d = mod(c, 3) + 1
      e = mod(d, 3) + 1
      spin(c) = dot_product(momentum/trace, cross(a(:, d), a(:, e)))/determinant
    end do
  end function spin_of

end module pd_output_measures_fragments

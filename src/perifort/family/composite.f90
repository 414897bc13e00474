!> Composite families: bonds within a grid are those of its lattice, bonds between grids, and those
!> of points on no grid, are in a list. The list has slots of its own, for the points that have such
!> bonds alone.
module pd_family_composite
  use pd_base_archive, only: archive_type
  use pd_base_error, only: error_type
  use pd_base_kinds, only: wp, i4, i8
  use pd_base_text, only: to_text
  use pd_body_body, only: allocate_points, body_type
  use pd_family_family, only: allocate_bonds, bonds_type, family_type
  use pd_family_lattice, only: grids_fit, lattice_family_type, new_lattice_family
  use pd_family_list, only: list_family_type, new_list_family
  use pd_family_volume, only: volume_rule_type
  implicit none (type, external)
  private
  public :: composite_family_type, composite_suits, new_composite_family

  !> Part of the points that may have bonds in the list: beyond it one list of all is as fast.
  real(wp), parameter :: most_listed = 0.5_wp

  type, extends(family_type) :: composite_family_type
    type(lattice_family_type) :: lattice       !! its slots are those of the family
    type(list_family_type) :: list             !! with slots of its own
    integer(i4), allocatable :: slot(:)        !! of each live slot of the list, its slot here
    integer(i4), allocatable :: place(:)       !! of each slot, its slot of the list; 0: has none
    integer :: first_free = 0                  !! the first slot behind the grids
  contains
    procedure :: bonds_of
    procedure :: break_bond
    procedure :: keep_bonds
    procedure :: bytes
    procedure :: describe
    procedure :: alike
    procedure :: may_have_broken
    procedure :: bytes_are_shared
  end type composite_family_type

contains

  !> Whether the grids of a body can have lattices that a list joins, and few enough points have
  !> bonds in that. Otherwise `reason` says why not.
  subroutine composite_suits(body, rule, listed, suits, reason)
    type(body_type), intent(in) :: body         !! in point order, not yet arranged in slots
    type(volume_rule_type), intent(in) :: rule  !! how far families reach
    logical, intent(in) :: listed(:)            !! (n_points) from `find_listed`
    logical, intent(out) :: suits               !! a composite family can be made
    character(:), allocatable, intent(out) :: reason
      !! why not, without a full stop; empty if it suits

    suits = .false.
    if (all(body%grid == 0)) then
      reason = 'no point is on a grid'
    else if (count(listed) > most_listed*body%n_points) then
      reason = 'too many points have bonds beyond their grid'
    else
      call grids_fit(body, rule, suits, reason)
    end if
  end subroutine composite_suits

  !> Families of a body that `composite_suits`; the body is arranged in slots: those of its grids,
  !> and behind them those of points on no grid. An error is set where the lattices cannot be made.
  subroutine new_composite_family(body, rule, listed, breakable, family, error)
    type(body_type), intent(inout) :: body
      !! in point order; arranged in the slots of the family on return
    type(volume_rule_type), intent(in) :: rule         !! volume correction and horizon
    logical, intent(in) :: listed(:)                   !! (n_points) from `find_listed`
    logical, intent(in) :: breakable                   !! bonds may break or be cut
    type(composite_family_type), intent(out) :: family !! whole, all bonds intact
    type(error_type), allocatable, intent(out) :: error
    type(body_type) :: joint
    integer(i4), allocatable :: chosen(:)
    integer :: k, n

    n = count(listed)
    chosen = pack([(int(k, i4), k=1, body%n_points)], listed)
    call allocate_points(joint, body%dim, n)
    joint%x = body%x(chosen, :)
    joint%volume = body%volume(chosen)
    joint%spacing = body%spacing(chosen)
    joint%body = body%body(chosen)
    joint%material = body%material(chosen)
    joint%grid = body%grid(chosen)
    call new_list_family(joint, rule, family%list, apart=.true.)
    call new_lattice_family(body, rule, breakable, .false., family%lattice, error, listed=listed)
    if (allocated(error)) return
    family%dim = body%dim
    family%n_slots = body%n_slots
    family%rule = rule
    family%slot = body%slot(chosen(joint%point(:n)))
    allocate (family%place(body%n_slots), source=0_i4)
    do k = 1, n
      family%place(family%slot(k)) = int(k, i4)
    end do
    associate (grids => family%lattice%grids)
      family%first_free = int(grids(size(grids))%last) + 1
    end associate
    family%n_bonds = family%lattice%n_bonds + family%list%n_bonds
    family%most_bonds = family%lattice%most_bonds
    do k = 1, n
      family%most_bonds = max(family%most_bonds, family%lattice%number_at(family%slot(k)) &
        & + family%list%number_at(k))
    end do
  end subroutine new_composite_family

  !> All bonds of slot `k`: those of its lattice, then those of the list; broken ones too.
  pure subroutine bonds_of(family, k, bonds)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot; a dead one has no bonds
    type(bonds_type), intent(inout) :: bonds
      !! made by `allocate_bonds`; the first `bonds%n` entries are set
    type(bonds_type) :: more
    integer :: n

    call family%lattice%bonds_of(k, bonds)
    if (family%place(k) == 0_i4) return
    call allocate_bonds(family%list, more)
    call family%list%bonds_of(int(family%place(k)), more)
    n = bonds%n
    bonds%n = n + more%n
    bonds%j(n + 1:bonds%n) = family%slot(more%j(:more%n))
    bonds%xi(n + 1:bonds%n, :) = more%xi(:more%n, :)
    bonds%length(n + 1:bonds%n) = more%length(:more%n)
    bonds%weight(n + 1:bonds%n) = more%weight(:more%n)
    bonds%intact(n + 1:bonds%n) = more%intact(:more%n)
  end subroutine bonds_of

  !> Break the `i`-th bond of slot `k`; the other direction is another call.
  pure subroutine break_bond(family, k, i)
    class(composite_family_type), intent(inout) :: family  !! with this bond broken on return
    integer, intent(in) :: k                               !! slot whose bond is broken
    integer, intent(in) :: i  !! number of the bond in `bonds_of(k)`, from 1
    integer :: n

    n = family%lattice%number_at(k)
    if (i <= n) then
      call family%lattice%break_bond(k, i)
    else
      call family%list%break_bond(int(family%place(k)), i - n)
    end if
  end subroutine break_bond

  !> Keep which bonds are broken, or put it back.
  subroutine keep_bonds(family, archive)
    class(composite_family_type), intent(inout) :: family
      !! its broken bonds are set where the archive reads
    class(archive_type), intent(inout) :: archive  !! a checkpoint that is written or read

    if (allocated(family%lattice%broken)) call family%lattice%keep_bonds(archive)
    call family%list%keep_bonds(archive)
  end subroutine keep_bonds

  !> Memory of both parts [bytes].
  pure integer(i8) function bytes(family)
    class(composite_family_type), intent(in) :: family  !! the family
    bytes = family%lattice%bytes() + family%list%bytes() + 4_i8*size(family%place) &
      & + 4_i8*size(family%slot)
  end function bytes

  !> The grids, and how much is in the list, in a line.
  function describe(family) result(text)
    class(composite_family_type), intent(in) :: family  !! the family
    character(:), allocatable :: text

    text = family%lattice%describe()//', and a list of the '// &
      & to_text(100*real(family%list%n_bonds, wp)/max(1_i8, family%n_bonds), 2)// &
      & ' % of the bonds that join grids'
    if (any(family%place(family%first_free:) > 0_i4)) text = text//' or points on none'
  end function describe

  !> A slot with the same bonds: one without bonds in the list, of the same class of its lattice.
  pure integer function alike(family, k)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot
    alike = k
    if (family%place(k) == 0_i4) alike = family%lattice%alike(k)
  end function alike

  !> Whether some bond of slot `k` is broken.
  pure logical function may_have_broken(family, k)
    class(composite_family_type), intent(in) :: family  !! the family
    integer, intent(in) :: k                            !! slot
    may_have_broken = family%lattice%may_have_broken(k)
    if (family%place(k) > 0_i4) may_have_broken = may_have_broken .or. &
      & family%list%may_have_broken(int(family%place(k)))
  end function may_have_broken

  !> Bonds of slots that lie far apart may share a byte of the list.
  pure logical function bytes_are_shared(family)
    class(composite_family_type), intent(in) :: family  !! the family
    bytes_are_shared = size(family%slot) > 0
  end function bytes_are_shared

end module pd_family_composite

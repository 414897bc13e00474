!> A material in one file: a bond law with a history, used by a program without a change of the
!> library. doc/own-law.md goes through it.
!>
!> Bonds are elastic up to a stretch of `slip_stretch` and slip beyond it, with a hardening h: with
!> the slip z of a bond, its pull is q (s - z), and it slips where |s - (1 + h) z| would exceed
!> `slip_stretch`. A bar of such bonds has the stress E eps up to that strain, and then the slope
!> E h/(1 + h).
module slipping
  use perifort, only: bond_law_type, law_bonds_type, wp
  implicit none (type, external)
  private
  public :: slipping_law_type, slipping_law

  type, extends(bond_law_type) :: slipping_law_type
    real(wp) :: slip_stretch = 1.0e-3_wp  !! stretch at which a bond begins to slip [-]
    real(wp) :: hardening = 0.25_wp       !! h: kinematic hardening over elastic stiffness [-]
  contains
    procedure :: forces
    procedure :: energy
    procedure :: stiffness
    procedure :: commit
  end type slipping_law_type

contains

  !> The law as a scene names it: one real of history for each direction of a bond.
  function slipping_law() result(law)
    type(slipping_law_type) :: law
    law%name = 'slipping'
    law%bond_based = .true.  ! Poisson's ratio is that of bond-based bodies
    law%bond_history = 1
  end function slipping_law

  !> The slip that belongs to a stretch `s`, from the committed slip `z`.
  elemental real(wp) function slip(self, s, z)
    class(slipping_law_type), intent(in) :: self
    real(wp), intent(in) :: s, z
    real(wp) :: driving

    driving = s - (1 + self%hardening)*z
    slip = z + sign(max(0.0_wp, abs(driving) - self%slip_stretch)/(1 + self%hardening), driving)
  end function slip

  !> q (s - z) of each intact bond.
  pure subroutine forces(self, bonds, pull)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: pull(:)

    associate (n => bonds%n)
      pull = self%material%q*(bonds%stretch(:n) - slip(self, bonds%stretch(:n), &
        & bonds%history(1, :n)))
      where (bonds%volume(:n) <= 0.0_wp) pull = 0.0_wp
    end associate
  end subroutine forces

  !> (q/2) sum ((s - z)^2 + h z^2) |xi| vc V.
  pure real(wp) function energy(self, bonds)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp) :: z(bonds%n)

    associate (n => bonds%n)
      z = slip(self, bonds%stretch(:n), bonds%history(1, :n))
      energy = self%material%q/2*sum(((bonds%stretch(:n) - z)**2 + self%hardening*z**2) &
        & *bonds%length(:n)*bonds%volume(:n))
    end associate
  end function energy

  !> Slipping bonds are softer than elastic ones: q/|xi|.
  pure subroutine stiffness(self, bonds, bound)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(in) :: bonds
    real(wp), intent(out) :: bound(:)
    bound = self%material%q/bonds%length(:bonds%n)
  end subroutine stiffness

  !> The new slip, and what it dissipates: q slip_stretch |dz| |xi| vc V.
  pure subroutine commit(self, bonds, dissipated)
    class(slipping_law_type), intent(in) :: self
    type(law_bonds_type), intent(inout) :: bonds
    real(wp), intent(out) :: dissipated
    real(wp) :: z(bonds%n)

    associate (n => bonds%n)
      z = slip(self, bonds%stretch(:n), bonds%history(1, :n))
      dissipated = self%material%q*self%slip_stretch*sum(abs(z - bonds%history(1, :n)) &
        & *bonds%length(:n)*bonds%volume(:n))
      bonds%history(1, :n) = z
    end associate
  end subroutine commit

end module slipping

!> A bar of slipping bonds, stretched to three times the strain at which they begin to slip.
program own_law
  use perifort, only: all_laws, answer_type, error_type, law_table_type, read_scene_text, &
    & run_options_type, run_scene, scene_type, wp
  use slipping, only: slipping_law
  implicit none (type, external)
  character(*), parameter :: nl = new_line('a')
  character(*), parameter :: text = '&scene dimension = 1, area = 1e-4 /'//nl// &
    & '&body lower = 0, upper = 0.1, points = 100 /'//nl// &
    & "&material model = 'slipping', youngs_modulus = 70e9 /"//nl// &
    & "&horizon surface_correction = 'none' /"//nl// &
    & "&boundary side = 'x_min', displacement_x = 0 /"//nl// &
    & "&boundary name = 'pulled', side = 'x_max', displacement_x = 3.0e-4 /"//nl// &
    & "&time method = 'relaxation' /"//nl// &
    & '&relaxation load_steps = 12 /'//nl
  type(law_table_type) :: laws
  type(scene_type) :: scene
  type(run_options_type) :: options
  type(answer_type) :: answer
  type(error_type), allocatable :: error
  real(wp), allocatable :: force(:)
  real(wp) :: slope, expected
  integer :: n

  laws = all_laws()
  call laws%add(slipping_law())
  call read_scene_text(text, '', scene, error, laws=laws)
  call stop_at(error)
  options%files = .false.
  options%quiet = .true.
  call run_scene(scene, options, error, answer=answer)
  call stop_at(error)
  call answer%get_column('pulled_reaction_x', force, error)
  call stop_at(error)

  ! rows are load steps: elastic ones first, slipping ones last
  n = size(force)
  slope = (force(n) - force(n - 1))/(force(2) - force(1))
  expected = 0.25_wp/1.25_wp
  print '(a, f8.5, a, f8.5)', 'slope after the slip over the elastic one: ', slope, &
    & ', expected ', expected
  if (.not. abs(slope - expected) <= 1.0e-4_wp) error stop 'the bar does not slip as it should'

contains

  !> End the program at an error.
  subroutine stop_at(error)
    type(error_type), allocatable, intent(in) :: error
    if (.not. allocated(error)) return
    print '(a)', error%message
    error stop 1
  end subroutine stop_at

end program own_law
